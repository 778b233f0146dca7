//! Host and GLSL layouts are the same: member offsets and strides, read from the SPIR-V.

use std::collections::HashMap;
use std::mem::offset_of;

use mesoshell::gpu::shaders::{self, Spirv};
use mesoshell::method::shell::ViewConstants;
use mesoshell::method::shell::lit::{Frame, LightSource, Lighting, LitCell};
use mesoshell::method::shell::seen::{Cell, Tile};
use rspirv::binary::parse_words;
use rspirv::dr::{Instruction, Loader, Module, Operand};
use rspirv::spirv::{Decoration, Op};

/// Name and offset of each member of the struct type `name`, and the stride of arrays of it, if there are any.
fn layout(shader: Spirv, name: &str) -> (Vec<(String, u32)>, Option<u32>) {
    let mut loader = Loader::new();
    parse_words(shader.words(), &mut loader).expect("glslang wrote it");
    let module: Module = loader.module();
    let id_of = |operand: &Operand| operand.unwrap_id_ref();
    let id = module
        .debug_names
        .iter()
        .filter(|i| i.class.opcode == Op::Name && i.operands[1].unwrap_literal_string() == name)
        .map(|i| id_of(&i.operands[0]))
        .find(|id| {
            module
                .annotations
                .iter()
                .any(|i| i.class.opcode == Op::MemberDecorate && id_of(&i.operands[0]) == *id)
        })
        .unwrap_or_else(|| panic!("no struct {name} with a layout"));
    let names: HashMap<u32, String> = module
        .debug_names
        .iter()
        .filter(|i| i.class.opcode == Op::MemberName && id_of(&i.operands[0]) == id)
        .map(|i| (i.operands[1].unwrap_literal_bit32(), i.operands[2].unwrap_literal_string().to_owned()))
        .collect();
    let is_offset = |i: &&Instruction| {
        i.class.opcode == Op::MemberDecorate
            && id_of(&i.operands[0]) == id
            && i.operands[2] == Operand::Decoration(Decoration::Offset)
    };
    let mut members: Vec<(u32, u32)> = module
        .annotations
        .iter()
        .filter(is_offset)
        .map(|i| (i.operands[1].unwrap_literal_bit32(), i.operands[3].unwrap_literal_bit32()))
        .collect();
    members.sort_unstable();
    let array = module
        .types_global_values
        .iter()
        .find(|i| i.class.opcode == Op::TypeRuntimeArray && id_of(&i.operands[0]) == id)
        .and_then(|i| i.result_id);
    let stride = array.and_then(|array| {
        module
            .annotations
            .iter()
            .find(|i| {
                i.class.opcode == Op::Decorate
                    && id_of(&i.operands[0]) == array
                    && i.operands[1] == Operand::Decoration(Decoration::ArrayStride)
            })
            .map(|i| i.operands[2].unwrap_literal_bit32())
    });
    (members.into_iter().map(|(index, offset)| (names[&index].clone(), offset)).collect(), stride)
}

/// The same of a host struct.
macro_rules! host {
    ($type:ty: $($member:ident),+) => {
        vec![$((stringify!($member).to_owned(), offset_of!($type, $member) as u32)),+]
    };
}

const UNLIT: [Spirv; 4] =
    [shaders::SHELL_FRAG, shaders::SHELL_DEPTH_FRAG, shaders::CYCLE_FRAG, shaders::CYCLE_DEPTH_FRAG];
const LIT: [Spirv; 4] = [
    shaders::SHELL_LIT_FRAG,
    shaders::SHELL_LIT_DEPTH_FRAG,
    shaders::CYCLE_LIT_FRAG,
    shaders::CYCLE_LIT_DEPTH_FRAG,
];

#[test]
fn structs_of_lit_scenes_agree() {
    for shader in LIT {
        let (members, stride) = layout(shader, "LitCell");
        assert_eq!(
            (members, stride),
            (host!(LitCell: frames, per_height), Some(size_of::<LitCell>() as u32))
        );
        let (members, stride) = layout(shader, "Frame");
        assert_eq!((members, stride), (host!(Frame: columns), Some(size_of::<Frame>() as u32)));
        let (members, stride) = layout(shader, "LightSource");
        assert_eq!(
            (members, stride),
            (host!(LightSource: place, colour), Some(size_of::<LightSource>() as u32))
        );
        let mut lighting = host!(Lighting: world_from_view, ambient, diffuse, specular, shininess, count);
        lighting.push(("sources".to_owned(), size_of::<Lighting>() as u32));
        assert_eq!(layout(shader, "Lighting").0, lighting);
    }
}

/// The descriptors of a shader: their bindings, sorted.
fn bindings(shader: Spirv) -> Vec<u32> {
    let mut loader = Loader::new();
    parse_words(shader.words(), &mut loader).expect("glslang wrote it");
    let module: Module = loader.module();
    let binding = |i: &Instruction| {
        (i.class.opcode == Op::Decorate && i.operands[1] == Operand::Decoration(Decoration::Binding))
            .then(|| i.operands[2].unwrap_literal_bit32())
    };
    let mut bindings: Vec<u32> = module.annotations.iter().filter_map(binding).collect();
    bindings.sort_unstable();
    bindings
}

/// An unlit scene's shaders have nothing of what light needs: they are what they were before there was any.
#[test]
fn nothing_of_light_is_compiled_in_where_a_scene_is_unlit() {
    let words = |shader: Spirv| String::from_utf8_lossy(bytemuck::cast_slice(shader.words())).into_owned();
    for (unlit, lit) in UNLIT.into_iter().zip(LIT) {
        for name in ["radiant", "frames", "lighting", "directions", "FIBRE"] {
            assert!(!words(unlit).contains(name) && words(lit).contains(name), "{name}");
        }
    }
    assert_eq!(bindings(shaders::SHELL_FRAG), [3]);
    assert_eq!(bindings(shaders::SHELL_LIT_FRAG), [3, 4, 5, 6, 7]);
    assert_eq!(bindings(shaders::CYCLE_FRAG), [0, 2, 3]);
    assert_eq!(bindings(shaders::CYCLE_LIT_FRAG), [0, 2, 3, 4, 5, 6, 7]);
}

#[test]
fn shell_structs_agree() {
    let constants = host!(ViewConstants: centre, pixel, near, texels, last_level, lod_scale, per_opacity_distance, step, samples);
    // The vertex shader reads no constants, but the fragment shaders do.
    for shader in UNLIT.into_iter().chain(LIT) {
        assert_eq!(layout(shader, "View").0, constants);
    }
    let (members, stride) = layout(shaders::SHELL_VERT, "Cell");
    assert_eq!(members, host!(Cell: outline, planes, texture));
    assert_eq!(stride, Some(size_of::<Cell>() as u32));
    for shader in [shaders::SHELL_LIT_VERT, shaders::CYCLE_FRAG, shaders::CYCLE_LIT_FRAG] {
        assert_eq!(layout(shader, "Cell"), (members.clone(), stride));
    }
    let (members, stride) = layout(shaders::CYCLE_VERT, "Tile");
    assert_eq!(members, host!(Tile: bounds, members));
    assert_eq!(stride, Some(size_of::<Tile>() as u32));
}

#[test]
fn a_wrong_member_is_noticed() {
    let (mut members, _) = layout(shaders::SHELL_VERT, "Cell");
    assert_eq!(members.len(), 3);
    members[1].1 += 4;
    assert_ne!(members, host!(Cell: outline, planes, texture));
}
