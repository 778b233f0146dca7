//! Host and GLSL layouts are the same: member offsets and strides, read from the SPIR-V.

use std::collections::HashMap;
use std::mem::offset_of;

use mesoshell::gpu::PICTURE;
use mesoshell::gpu::shaders::{self, Spirv};
use mesoshell::method::shell::ViewConstants;
use mesoshell::method::shell::lit::{Frame, LightSource, Lighting};
use mesoshell::method::shell::seen::{Cell, Tile};
use mesoshell::method::shell::shadows::{Blocker, LightPicture, MOST_PICTURES};
use mesoshell::method::shell::solids::Triangle;
use mesoshell::scene::shading::MOST_LIGHTS;
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
        .find(|i| {
            matches!(i.class.opcode, Op::TypeRuntimeArray | Op::TypeArray) && id_of(&i.operands[0]) == id
        })
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

/// The fragment shaders of the shell: in every variant that is lit, or that is not.
fn of_the_shell(lit: bool) -> Vec<Spirv> {
    let sets: [&[&str]; 4] = [&[], &["DEPTH"], &["SOLIDS"], &["SOLIDS", "DEPTH"]];
    let lights: &[&[&str]] = if lit { &[&["LIT"], &["LIT", "SHADOWS"]] } else { &[&[]] };
    let mut found = Vec::new();
    for family in [&shaders::SHELL_FRAG, &shaders::CYCLE_FRAG] {
        for set in sets {
            found.extend(lights.iter().map(|light| family.with(&[set, light].concat())));
        }
    }
    found
}

/// The fragment shaders that read the pictures of lights.
fn shadowed() -> Vec<Spirv> {
    let on = ["LIT", "SHADOWS"];
    [&shaders::SHELL_FRAG, &shaders::CYCLE_FRAG, &shaders::SURFACE_FRAG]
        .map(|family| family.with(&on))
        .to_vec()
}

#[test]
fn structs_of_lit_scenes_agree() {
    // Of nine texels: `frame.glsl`.
    assert_eq!(size_of::<Frame>(), 9 * 16);
    for shader in of_the_shell(true) {
        let (members, stride) = layout(shader, "LightSource");
        assert_eq!(
            (members, stride),
            (host!(LightSource: place, colour), Some(size_of::<LightSource>() as u32))
        );
        let mut lighting =
            host!(Lighting: world_from_view, ambient, diffuse, specular, shininess, glow, glow_from);
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

/// What a scene has nothing of is not compiled in.
#[test]
fn nothing_is_compiled_in_that_a_scene_does_not_need() {
    let words = |shader: Spirv| String::from_utf8_lossy(bytemuck::cast_slice(shader.words())).into_owned();
    let of_light: &[&str] = &["look_along", "frames", "lighting", "directions", "FIBRE", "GLOW"];
    let of_shadows: &[&str] = &["light_pictures", "curves", "let_through"];
    let of_solids: &[&str] = &["solid_depth", "solid_depths"];
    let of_depth: &[&str] = &["out_depth"];
    let of_leaps: &[&str] = &["proximity"];
    let families =
        [&shaders::SHELL_FRAG, &shaders::WALK_FRAG, &shaders::SHADOW_FRAG, &shaders::SHADOW_LEFT_FRAG];
    for family in families {
        let (without, with) = (words(family.with(&[])), words(family.with(&["SPARSE"])));
        assert!(of_leaps.iter().all(|name| !without.contains(name) && with.contains(name)));
    }
    for family in [&shaders::SHELL_FRAG, &shaders::WALK_FRAG, &shaders::TOGETHER_FRAG, &shaders::SHADOW_FRAG]
    {
        let (without, with) = (words(family.with(&["SPARSE"])), words(family.with(&["SPARSE", "EVEN"])));
        assert!(!without.contains("pass_evenly") && with.contains("pass_evenly"));
    }
    for family in [&shaders::SHELL_FRAG, &shaders::CYCLE_FRAG, &shaders::WALK_FRAG, &shaders::TOGETHER_FRAG] {
        let switches =
            [("LIT", of_light), ("SHADOWS", of_shadows), ("SOLIDS", of_solids), ("DEPTH", of_depth)];
        for (switch, names) in switches {
            let base: &[&str] = if switch == "SHADOWS" { &["LIT"] } else { &[] };
            let (without, with) = (words(family.with(base)), words(family.with(&[base, &[switch]].concat())));
            for name in names {
                assert!(!without.contains(name) && with.contains(name), "{switch}: {name}");
            }
        }
    }
    let shell = |on: &[&str]| bindings(shaders::SHELL_FRAG.with(on));
    assert_eq!(shell(&[]), [8]);
    assert_eq!(shell(&["SPARSE"]), [8, 22]);
    assert_eq!(bindings(shaders::WALK_FRAG.with(&[])), [8, 18, 19, 20, 21]);
    assert_eq!(bindings(shaders::SHADOW_FRAG.with(&[])), [6, 8, 18, 19, 20, 21]);
    assert_eq!(bindings(shaders::SHADOW_LEFT_FRAG.with(&[])), [0, 2, 6, 8]);
    assert_eq!(bindings(shaders::SHADOW_FRAG.with(&["SOLIDS"])), [6, 8, 14, 18, 19, 20, 21]);
    assert_eq!(bindings(shaders::SHADOW_LEFT_FRAG.with(&["SOLIDS"])), [0, 2, 6, 8, 14]);
    assert_eq!(shell(&["SOLIDS"]), [8, 15]);
    assert_eq!(shell(&["LIT"]), [3, 5, 8, 9]);
    assert_eq!(shell(&["LIT", "SHADOWS"]), [3, 5, 6, 8, 9, 10]);
    assert_eq!(shell(&["LIT", "SHADOWS", "SOLIDS"]), [3, 5, 6, 8, 9, 10, 14, 15]);
    let surface = |on: &[&str]| bindings(shaders::SURFACE_FRAG.with(on));
    assert_eq!(bindings(shaders::SATURATED_FRAG.with(&[])), [PICTURE]);
    assert_eq!(surface(&[]), [15, 17, 23]);
    assert_eq!(surface(&["LIT", "SHADOWS"]), [5, 6, 10, 14, 15, 17, 23]);
    assert_eq!(bindings(shaders::CYCLE_FRAG.with(&[])), [0, 2, 8]);
    assert_eq!(bindings(shaders::CYCLE_FRAG.with(&["LIT"])), [0, 2, 3, 5, 8, 9]);
}

#[test]
fn shell_structs_agree() {
    let constants = host!(ViewConstants: centre, pixel, near, texels, last_level, lod_scale, per_opacity_distance, step, samples, even,
        even_steps);
    // The shell's vertex shader reads no constants, but the fragment shaders do.
    let others = [
        shaders::SHADOW_FRAG.with(&[]),
        shaders::SHADOW_LEFT_FRAG.with(&[]),
        shaders::SOLID_FRAG.with(&[]),
        shaders::SOLID_VERT.with(&[]),
        shaders::SURFACE_FRAG.with(&[]),
        shaders::BLOCKER_VERT.with(&[]),
    ];
    for shader in of_the_shell(false).into_iter().chain(of_the_shell(true)).chain(others) {
        assert_eq!(layout(shader, "View").0, constants);
    }
    let (members, stride) = layout(shaders::SHELL_VERT.with(&[]), "Cell");
    assert_eq!(members, host!(Cell: outline, planes, texture));
    assert_eq!(stride, Some(size_of::<Cell>() as u32));
    let others = [
        shaders::SHELL_VERT.with(&["LIT"]),
        shaders::CYCLE_FRAG.with(&[]),
        shaders::CYCLE_FRAG.with(&["LIT"]),
        shaders::SHADOW_LEFT_FRAG.with(&[]),
    ];
    for shader in others {
        assert_eq!(layout(shader, "Cell"), (members.clone(), stride));
    }
    for on in [&[][..], &["LIGHT"], &["LIGHT", "WALKED"]] {
        let (members, stride) = layout(shaders::TILE_VERT.with(on), "Tile");
        assert_eq!(members, host!(Tile: bounds, members, picture, coarsely));
        assert_eq!(stride, Some(size_of::<Tile>() as u32));
    }
}

#[test]
fn structs_of_solids_and_shadows_agree() {
    let (members, stride) = layout(shaders::SOLID_VERT.with(&[]), "Triangle");
    assert_eq!(members, host!(Triangle: corners, plane));
    assert_eq!(stride, Some(size_of::<Triangle>() as u32));
    let (members, stride) = layout(shaders::BLOCKER_VERT.with(&[]), "Blocker");
    assert_eq!(members, host!(Blocker: corners, depth_function, picture));
    assert_eq!(stride, Some(size_of::<Blocker>() as u32));
    let others =
        [shaders::SHADOW_FRAG, shaders::SHADOW_LEFT_FRAG, shaders::BLOCKER_VERT, shaders::BLOCKER_FRAG]
            .map(|family| family.with(&[]));
    for shader in shadowed().into_iter().chain(others) {
        let (members, stride) = layout(shader, "LightPicture");
        let expected = host!(LightPicture: from_world, middle, half_side, pixel, is_parallel,
            opacity_distances, rounding);
        assert_eq!((members, stride), (expected, Some(size_of::<LightPicture>() as u32)));
    }
}

/// Arrays of uniform buffers are as long as the host fills them.
#[test]
fn lights_are_as_many_as_the_host_uploads() {
    let lights = include_str!("../glsl/include/lights.glsl");
    assert!(lights.contains(&format!("const uint MOST_LIGHTS = {MOST_LIGHTS};")));
    assert!(lights.contains("const uint MOST_PICTURES = 6 * MOST_LIGHTS;"));
    assert_eq!(MOST_PICTURES, 6 * MOST_LIGHTS);
}

#[test]
fn a_wrong_member_is_noticed() {
    let (mut members, _) = layout(shaders::SHELL_VERT.with(&[]), "Cell");
    assert_eq!(members.len(), 3);
    members[1].1 += 4;
    assert_ne!(members, host!(Cell: outline, planes, texture));
}
