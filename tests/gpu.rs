//! What the device layer refuses, and that it refuses before it asks the driver: nothing here may make the validation
//! layers speak.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use glam::{DVec2, DVec3};
use mesoshell::Error;
use mesoshell::gpu::{
    Batch, Buffer, DeviceChoice, Draw, Gpu, Keeps, Marked, Messages, Pipeline, PipelineInfo, Sampled, Target,
    Texture3d, devices, draw, shaders,
};
use mesoshell::mesh::Mesh;
use mesoshell::mesh::generate::{Generator, Sphere};
use mesoshell::method::shell::ViewConstants;
use mesoshell::method::{self, Setup};
use mesoshell::progress::{Interrupt, Progress};
use mesoshell::scene::{March, Scene};
use mesoshell::shell::{Shell, ShellOptions};
use mesoshell::volume::{Pyramid, Quantity, Volume};

fn watched(test: impl FnOnce(&Arc<Gpu>)) {
    let messages = Messages::default();
    let gpu =
        Gpu::open(&DeviceChoice::Any, Some(&messages)).unwrap_or_else(|error| panic!("{error}\n{error:?}"));
    test(&gpu);
    drop(gpu);
    assert_eq!(messages.all(), Vec::<String>::new());
}

fn empty(size: [u32; 3]) -> Pyramid {
    let texels = size.iter().map(|side| *side as usize).product();
    Pyramid { levels: vec![Volume { size, texels: vec![[0.0; 4]; texels], quantity: Quantity::Opacity }] }
}

/// The pipeline of the sorted tetrahedra.
fn shell_pipeline(push_constant_bytes: u32) -> PipelineInfo<'static> {
    PipelineInfo {
        vertex: shaders::SHELL_VERT.with(&[]),
        fragment: shaders::SHELL_FRAG.with(&[]),
        constants: &[],
        storage_buffers: &[0, 1, 2],
        uniform_buffers: &[],
        texel_buffers: &[],
        textures: &[8],
        minified: true,
        push_constant_bytes,
        keeps: Keeps::Blend,
    }
}

#[test]
fn a_device_is_chosen_by_index_name_and_uuid() {
    let all = devices().expect("a Vulkan driver");
    let first = &all[0];
    for text in ["0", &first.name.to_uppercase()[..5], &first.uuid.to_uppercase()] {
        let choice: DeviceChoice = text.parse().unwrap();
        assert_eq!(Gpu::open(&choice, None).expect(text).info(), first, "{text}");
    }
    for text in ["99", "no such device", "00000000-dead-beef-0000-000000000000"] {
        let choice: DeviceChoice = text.parse().unwrap();
        let error = Gpu::open(&choice, None).expect_err(text);
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains(text), "{error}");
    }
}

/// Every driver of Vulkan 1.2 tells its name; `watched` that asking for it is allowed.
#[test]
fn the_driver_is_told_by_name() {
    watched(|gpu| {
        let driver = &gpu.info().driver;
        assert!(driver.contains(char::is_alphabetic) && driver.contains(char::is_numeric), "{driver}");
    });
}

#[test]
fn a_volume_over_the_limit_is_refused() {
    watched(|gpu| {
        let limit = gpu.info().max_image_3d;
        let error = Texture3d::upload(gpu, "the volume", &empty([limit + 1, 1, 1])).unwrap_err();
        assert!(matches!(error, Error::Device { .. }), "{error:?}");
        assert!(error.to_string().contains(&limit.to_string()), "{error}");
        Texture3d::upload(gpu, "the volume", &empty([limit, 1, 1])).expect("the limit itself");
    });
}

#[test]
fn a_picture_over_the_limit_is_refused() {
    watched(|gpu| {
        let limit = gpu.info().max_image_2d;
        let error = Target::new(gpu, [limit + 1, 1], 1, Marked::Never).unwrap_err();
        assert!(matches!(error, Error::Device { .. }), "{error:?}");
        Target::new(gpu, [64, 64], 2, Marked::Never).expect("a small one");
    });
}

#[test]
fn a_picture_without_pixels_is_refused() {
    watched(|gpu| {
        for [width, height] in [[0, 1], [1, 0]] {
            let error = Target::new(gpu, [width, height], 1, Marked::Never).unwrap_err();
            assert!(matches!(error, Error::Usage { .. }), "{error:?}");
        }
    });
}

#[test]
fn a_pyramid_that_breaks_its_promises_reaches_no_device() {
    watched(|gpu| {
        let level = |size: [u32; 3], texels| Volume {
            size,
            texels: vec![[0.0; 4]; texels],
            quantity: Quantity::Opacity,
        };
        for levels in [
            vec![],
            vec![level([4, 4, 4], 63)],
            vec![level([0, 4, 4], 0)],
            vec![level([4, 2, 2], 16), level([2, 2, 1], 4)],
            vec![level([1, 1, 1], 1), level([1, 1, 1], 1)],
        ] {
            let upload = || Texture3d::upload(gpu, "the volume", &Pyramid { levels: levels.clone() });
            assert!(catch_unwind(AssertUnwindSafe(upload)).is_err(), "{levels:?}");
        }
    });
}

#[test]
fn a_picture_larger_than_memory_is_refused() {
    watched(|gpu| {
        let limit = gpu.info().max_image_2d;
        let bytes = u64::from(limit) * u64::from(limit) * 32 * 64;
        assert!(
            bytes > gpu.info().memory_bytes,
            "64 targets of the largest size fit: this machine is too large for the test"
        );
        let error = Target::new(gpu, [limit, limit], 64, Marked::Never).unwrap_err();
        assert!(matches!(error, Error::OutOfMemory { .. }), "{error:?}");
    });
}

#[test]
fn a_draw_whose_parts_do_not_fit_reaches_no_device() {
    watched(|gpu| {
        let other = Gpu::open(&DeviceChoice::Any, None).unwrap();
        let target = |gpu, attachments| Target::new(gpu, [4, 4], attachments, Marked::Never).unwrap();
        let bytes = size_of::<ViewConstants>();
        let pipeline = Pipeline::new(gpu, &target(gpu, 1), &shell_pipeline(bytes as u32)).unwrap();
        let buffer = |gpu| Buffer::storage(gpu, "nothing", &[0u32; 64]).unwrap();
        let volume = Texture3d::upload(gpu, "the volume", &empty([1, 1, 1])).unwrap();
        let draws = |target: &Target, buffers: &[&Buffer], bytes: usize| {
            let batches = [Batch { pipeline: &pipeline, vertices: 0..0 }];
            let parts = Draw {
                target,
                clears: true,
                buffers: &(0..).zip(buffers.iter().copied()).collect::<Vec<_>>(),
                textures: &[(8, Sampled::Texture(&volume))],
                push_constants: &vec![0; bytes],
                batches: &batches,
                between: &|_| Ok(()),
            };
            catch_unwind(AssertUnwindSafe(|| draw(&parts).unwrap())).is_ok()
        };
        let (own, foreign) = (buffer(gpu), buffer(&other));
        assert!(draws(&target(gpu, 1), &[&own; 3], bytes));
        assert!(!draws(&target(gpu, 2), &[&own; 3], bytes), "another number of attachments");
        assert!(!draws(&target(gpu, 1), &[&own; 2], bytes), "a buffer is missing");
        assert!(!draws(&target(gpu, 1), &[&own; 3], bytes - 4), "push constants are missing");
        assert!(!draws(&target(&other, 1), &[&own; 3], bytes), "another device's target");
        assert!(!draws(&target(gpu, 1), &[&own, &own, &foreign], bytes), "another device's buffer");
        for keeps in [Keeps::Nearest, Keeps::Marks, Keeps::BlendAbove, Keeps::BlendBelow] {
            let info = PipelineInfo { keeps, ..shell_pipeline(bytes as u32) };
            let wrong = || Pipeline::new(gpu, &target(gpu, 1), &info);
            assert!(catch_unwind(AssertUnwindSafe(wrong)).is_err(), "{keeps:?}: the target has no depths");
        }
        let marked = Target::new(gpu, [4, 4], 1, Marked::Apart).unwrap();
        assert!(!draws(&marked, &[&own; 3], bytes), "a pipeline for targets without marks");
    });
}

#[test]
fn what_the_layers_say_is_heard() {
    // The layers are really there: push constants that the shader reads and the pipeline does not have. (Nothing is drawn,
    // and the bindings are right: a driver may crash at wrong ones while it compiles.)
    let messages = Messages::default();
    let gpu = Gpu::open(&DeviceChoice::Any, Some(&messages)).unwrap();
    let target = Target::new(&gpu, [4, 4], 1, Marked::Never).unwrap();
    let _ = Pipeline::new(&gpu, &target, &shell_pipeline(4));
    assert!(!messages.all().is_empty());
}

#[test]
fn a_texture_too_fine_for_a_tetrahedron_is_told() {
    let render = |repeats: f64, march| {
        let options = ShellOptions { uv_scale: DVec2::new(repeats, 1.0), ..ShellOptions::new(0.1) };
        let volume = Volume::new([4, 1, 1], vec![[0.5; 4]; 4]).unwrap();
        let shell = Shell::build(&Mesh::triangle(), &options).unwrap();
        let mut scene = Scene::new(shell, Pyramid::build(volume), 0.1);
        (scene.view.width, scene.view.height, scene.march) = (4, 4, march);
        method::render(scene)
    };
    let is_warned = |repeats, march| {
        let warnings = render(repeats, march).unwrap().report.warnings;
        warnings.iter().any(|warning| warning.contains("shell.uv_scale"))
    };
    // At half a texel a sample, 65,535 samples are 8191.9 repeats of four texels.
    let march = March::default();
    assert!(!is_warned(8191.0, march) && is_warned(8193.0, march));
    assert!(!is_warned(8193.0, March::Paper { samples: 10 }));
    let error = render(262_145.0, march).unwrap_err();
    assert!(matches!(error, Error::Usage { .. }) && error.to_string().contains("texels along u"), "{error}");
}

/// Stops the run as soon as a part of the march is done.
struct Impatient(Interrupt);

impl Progress for Impatient {
    fn stage(&self, _: &str) {}
    fn fraction(&self, done: f64) {
        assert!(done > 0.0 && done < 1.0, "{done}");
        self.0.set();
    }
}

#[test]
fn an_interrupt_ends_the_march_between_its_parts() {
    let messages = Messages::default();
    let interrupt = Interrupt::default();
    let progress: Arc<dyn Progress> = Arc::new(Impatient(interrupt.clone()));
    let setup = Setup {
        device: &DeviceChoice::Any,
        validation: Some(&messages),
        progress: &progress,
        interrupt: &interrupt,
    };
    let view = mesoshell::stress::scenes::view(DVec3::new(0.0, 0.0, 4.0), DVec3::ZERO, 40.0, 0.01, 64);
    let mesh = Generator::Sphere(Sphere::default()).build().unwrap();
    let scene = Arc::new(mesoshell::stress::scenes::constant_scene(&mesh, 0.2, 0.5, 0.5, view).unwrap());
    let mut method = method::by_name("shell").unwrap().prepare(scene, &setup).unwrap();
    assert!(matches!(method.render(&view), Err(Error::Interrupted)));
    drop(method);
    assert_eq!(messages.all(), Vec::<String>::new());
}
