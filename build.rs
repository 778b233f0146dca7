//! Compiles every `glsl/*.STAGE.glsl` to SPIR-V with glslang; an error stops the build with file and line.
//!
//! A stage file may ask for variants by lines `// variant: NAME DEFINE...`: it is then compiled once more, with
//! each `DEFINE` defined, as `NAME`. The result is a Rust file with one constant a shader, included by
//! `src/gpu/shaders.rs`.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use glslang::include::{IncludeHandler, IncludeResult, IncludeType};
use glslang::{
    Compiler, CompilerOptions, Shader, ShaderInput, ShaderSource, ShaderStage, SpirvVersion, Target,
    VulkanVersion,
};

/// Resolves `#include "NAME"` to `glsl/include/NAME`.
struct Includes(PathBuf);

impl IncludeHandler for Includes {
    fn include(&mut self, _: IncludeType, name: &str, _: &str, _: usize) -> Option<IncludeResult> {
        let data = std::fs::read_to_string(self.0.join(name)).ok()?;
        Some(IncludeResult { name: name.to_owned(), data })
    }
}

fn main() -> ExitCode {
    println!("cargo::rerun-if-changed=glsl");
    match compile_all(Path::new("glsl")) {
        Ok(rust) => {
            let out = PathBuf::from(std::env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
            std::fs::write(out.join("shaders.rs"), rust).expect("OUT_DIR can be written");
            ExitCode::SUCCESS
        }
        Err(message) => {
            for line in message.lines() {
                println!("cargo::error={line}");
            }
            ExitCode::FAILURE
        }
    }
}

/// The Rust source of all shader constants.
fn compile_all(folder: &Path) -> Result<String, String> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .map_err(|error| format!("{}: {error}", folder.display()))?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.extension().is_some_and(|extension| extension == "glsl"))
        .collect();
    files.sort();
    let mut rust = String::new();
    for path in files {
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let file = path.file_name().expect("listed files have names").to_string_lossy();
        let (stem, stage) = file
            .strip_suffix(".glsl")
            .and_then(|rest| rest.rsplit_once('.'))
            .ok_or_else(|| format!("{}: a shader is named STEM.STAGE.glsl", path.display()))?;
        let mut variants = vec![(stem.to_owned(), None)];
        for line in text.lines().filter_map(|line| line.strip_prefix("// variant: ")) {
            let (name, define) = line
                .split_once(' ')
                .ok_or_else(|| format!("{}: a variant is `// variant: NAME DEFINE...`", path.display()))?;
            variants.push((name.to_owned(), Some(define)));
        }
        for (name, define) in variants {
            let words = compile(folder, &path, &text, stage, define)?;
            writeln!(
                rust,
                "/// SPIR-V of `{}`{}.",
                path.display(),
                define.map_or(String::new(), |define| format!(" with `{define}` defined"))
            )
            .and_then(|()| {
                writeln!(
                    rust,
                    "pub const {}_{}: Spirv = Spirv(&{words:?});",
                    name.to_uppercase(),
                    stage.to_uppercase()
                )
            })
            .expect("writing to a string");
        }
    }
    Ok(rust)
}

fn compile(
    folder: &Path,
    path: &Path,
    text: &str,
    stage: &str,
    define: Option<&str>,
) -> Result<Vec<u32>, String> {
    let stage = match stage {
        "vert" => ShaderStage::Vertex,
        "frag" => ShaderStage::Fragment,
        "comp" => ShaderStage::Compute,
        other => return Err(format!("{}: unknown stage `{other}`", path.display())),
    };
    // glslang prefixes its messages with the source's number and the line, `0:LINE:`.
    let explain = |error: &dyn std::fmt::Display| {
        error.to_string().replace("ERROR: 0:", &format!("{}:", path.display()))
    };
    let compiler = Compiler::acquire().ok_or("glslang could not be initialised")?;
    let source = ShaderSource::from(text.to_owned());
    let options = CompilerOptions {
        target: Target::Vulkan { version: VulkanVersion::Vulkan1_1, spirv_version: SpirvVersion::SPIRV1_3 },
        ..CompilerOptions::default()
    };
    let defines: Vec<(&str, Option<&str>)> =
        define.unwrap_or_default().split_whitespace().map(|name| (name, Some("1"))).collect();
    let mut includes = Includes(folder.join("include"));
    let input = ShaderInput::new(&source, stage, &options, Some(&defines[..]), Some(&mut includes))
        .map_err(|error| explain(&error))?;
    let shader: Shader = compiler.create_shader(input).map_err(|error| explain(&error))?;
    shader.compile().map_err(|error| explain(&error))
}
