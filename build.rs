//! Compiles every `glsl/*.STAGE.glsl` to SPIR-V with glslang; an error stops the build with file and line.
//!
//! A stage file may have a line `// switches: NAME NAME(OTHER)...`: it is then compiled once for each set of these names, with
//! each of the set defined; a name with another in brackets only together with that. The result is a Rust file with one
//! family of shaders a stage file, included by `src/gpu/shaders.rs`.

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
    let mut families = Vec::new();
    for path in files {
        let text = std::fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        let file = path.file_name().expect("listed files have names").to_string_lossy();
        let (stem, stage) = file
            .strip_suffix(".glsl")
            .and_then(|rest| rest.rsplit_once('.'))
            .ok_or_else(|| format!("{}: a shader is named STEM.STAGE.glsl", path.display()))?;
        let line = text.lines().find_map(|line| line.strip_prefix("// switches: ")).unwrap_or_default();
        let switches: Vec<Switch<'_>> = line.split_whitespace().map(Switch::parse).collect();
        let names: Vec<&str> = switches.iter().map(|switch| switch.name).collect();
        if let Some(unknown) =
            switches.iter().filter_map(|switch| switch.needs).find(|needs| !names.contains(needs))
        {
            return Err(format!("{}: a switch needs `{unknown}`, which is none", path.display()));
        }
        let family = format!("{}_{}", stem.to_uppercase(), stage.to_uppercase());
        let mut variants = String::new();
        for set in 0..1_usize << switches.len() {
            let on: Vec<&str> =
                (0..names.len()).filter(|bit| set >> bit & 1 == 1).map(|bit| names[bit]).collect();
            let is_possible = switches.iter().all(|switch| {
                !on.contains(&switch.name) || switch.needs.is_none_or(|needs| on.contains(&needs))
            });
            if is_possible {
                let words = compile(folder, &path, &text, stage, &on)?;
                write!(variants, "Some(Spirv(&{words:?})), ").expect("writing to a string");
            } else {
                variants.push_str("None, ");
            }
        }
        writeln!(
            rust,
            "/// `{}`.\npub static {family}: Family = Family {{ switches: &{names:?}, variants: &[{variants}] }};",
            path.display(),
        )
        .expect("writing to a string");
        families.push(format!("&{family}"));
    }
    writeln!(rust, "/// Every one of them.\npub static ALL: &[&Family] = &[{}];", families.join(", "))
        .expect("writing to a string");
    Ok(rust)
}

/// A name that a shader may be compiled with.
struct Switch<'a> {
    name: &'a str,
    /// Another that it makes no sense without.
    needs: Option<&'a str>,
}

impl<'a> Switch<'a> {
    fn parse(word: &'a str) -> Self {
        match word.split_once('(') {
            Some((name, needs)) => Self { name, needs: Some(needs.trim_end_matches(')')) },
            None => Self { name: word, needs: None },
        }
    }
}

fn compile(folder: &Path, path: &Path, text: &str, stage: &str, on: &[&str]) -> Result<Vec<u32>, String> {
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
    let defines: Vec<(&str, Option<&str>)> = on.iter().map(|name| (*name, Some("1"))).collect();
    let mut includes = Includes(folder.join("include"));
    let input = ShaderInput::new(&source, stage, &options, Some(&defines[..]), Some(&mut includes))
        .map_err(|error| explain(&error))?;
    let shader: Shader = compiler.create_shader(input).map_err(|error| explain(&error))?;
    shader.compile().map_err(|error| explain(&error))
}
