//! Recipes: what every volume they make has in common, and what is said of a recipe that makes no sense.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use mesoshell::volume::{Volume, recipe};
use mesoshell::{Error, Result};

/// All but `uniform`, which has neither edges nor chance.
const NAMES: [&str; 12] = [
    "chain-mail",
    "clouds",
    "ellipsoids",
    "figure",
    "fog",
    "fur",
    "grass",
    "height-map",
    "rocks",
    "scales",
    "trees",
    "weave",
];

fn shipped(name: &str) -> recipe::Recipe {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("volumes").join(name).with_extension("toml");
    recipe::load(path).unwrap_or_else(|error| panic!("{error}"))
}

fn recipe_of(name: &str, keys: &str) -> recipe::Recipe {
    let image = match name {
        "height-map" => "image = \"volumes/letters.png\"",
        // Of several the sizes differ.
        "figure" => "columns = 2\nrows = 2\nvariation = 0.5",
        _ => "",
    };
    // The keys that a test gives stand for those above.
    let key = |line: &str| line.split('=').next().unwrap_or_default().trim().to_owned();
    let own = |line: &&str| keys.lines().all(|given| key(given) != key(line));
    let image = image.lines().filter(own).collect::<Vec<_>>().join("\n");
    recipe::parse("test", &format!("recipe = \"{name}\"\n{image}\n{keys}")).unwrap()
}

fn small(name: &str, keys: &str) -> Volume {
    recipe_of(name, keys).build_with_size([40, 36, 12]).unwrap()
}

fn assert_sound(volume: &Volume, name: &str) {
    let count: u64 = volume.size.iter().map(|&n| u64::from(n)).product();
    assert_eq!(volume.texels.len() as u64, count, "{name}");
    for texel in &volume.texels {
        let [colour @ .., alpha] = texel;
        assert!(colour.iter().all(|c| c.is_finite() && *c >= 0.), "{name}: {texel:?}");
        assert!((0. ..=1.).contains(alpha), "{name}: {texel:?}");
    }
}

#[test]
fn shipped_recipes_are_sound_and_quick() {
    for name in NAMES {
        let recipe = shipped(name);
        let start = Instant::now();
        let volume = recipe.build().unwrap();
        // Ten times what two idle cores need.
        assert!(start.elapsed() < Duration::from_secs(3), "{name}: {:?}", start.elapsed());
        assert_eq!(volume.size, [128, 128, 32], "{name}");
        assert_sound(&volume, name);

        let slice = 128 * 128;
        let largest = volume.texels.iter().map(|texel| texel[3]).fold(0., f32::max);
        match name {
            "chain-mail" | "figure" | "grass" | "height-map" | "rocks" | "scales" | "trees" | "weave" => {
                assert_eq!(largest, 1., "{name} is not solid")
            }
            _ => assert!((0.1..0.98).contains(&largest), "{name}: alpha {largest}"),
        }
        let outer = &volume.texels[volume.texels.len() - slice..];
        assert!(outer.iter().all(|texel| texel[3] < 0.01), "{name} is cut off by the outer surface");
    }
}

/// A step from 0 to 1 over two voxels, as a smooth cubic, rises by at most 0.6875 from one texel to the next
/// (from t = 1/4 to 3/4); a tenth more is left for distances that are first-order estimates.
#[test]
fn edges_are_soft() {
    for name in NAMES {
        let mut volume = shipped(name).build().unwrap();
        let rise = steepest(&volume);
        assert!(rise < 0.76, "{name}: alpha rises by {rise} from one texel to the next");
        volume.texels.iter_mut().for_each(|texel| texel[3] = f32::from(texel[3] > 0.05));
        assert_eq!(steepest(&volume), 1., "{name}: hard edges are not seen");
    }
}

/// The largest difference of alpha between neighbouring texels.
fn steepest(volume: &Volume) -> f64 {
    let pairs = (0..3).flat_map(|axis| (1..volume.size[axis]).map(move |index| (axis, index)));
    pairs.map(|(axis, index)| step(volume, axis, index - 1, index).1).fold(0., f64::max)
}

#[test]
fn volumes_are_the_same_on_any_number_of_threads() {
    for name in NAMES {
        let once = small(name, "");
        for threads in [1, 2, 4] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            assert!(once == pool.install(|| small(name, "")), "{name} differs on {threads} threads");
        }
        assert!(once != small(name, "seed = 2"), "{name} has no seed");
    }
}

/// Root mean square and largest difference of alpha between two layers across `axis`.
fn step(volume: &Volume, axis: usize, from: u32, to: u32) -> (f64, f64) {
    let size = volume.size.map(|n| n as usize);
    let stride = size[..axis].iter().product::<usize>();
    let (mut squares, mut largest, mut count) = (0., 0f64, 0);
    for block in volume.texels.chunks_exact(stride * size[axis]) {
        let layer = |index: u32| block.chunks_exact(stride).nth(index as usize).unwrap();
        for (texel, other) in layer(from).iter().zip(layer(to)) {
            let difference = f64::from(other[3] - texel[3]).abs();
            squares += difference * difference;
            largest = largest.max(difference);
            count += 1;
        }
    }
    ((squares / f64::from(count)).sqrt(), largest)
}

/// The step across the border, from layer `last` to layer 0, relative to the largest one inside.
fn seam(volume: &Volume, axis: usize, last: u32) -> f64 {
    let inside = (0..last).map(|index| step(volume, axis, index, index + 1).0).fold(0., f64::max);
    step(volume, axis, last, 0).0 / inside
}

/// In a volume that repeats, the border is a step like any other and so, but for chance, not above the
/// largest of the 127 others. A seam where unrelated layers meet is well above it: shown by a border in the
/// wrong place.
#[test]
fn volumes_repeat_without_a_seam() {
    for name in NAMES {
        // Hairs and blades of about a voxel differ so much from texel to texel that no seam shows: thicker ones.
        if name == "figure" {
            continue; // It has gaps that show no seam: see below.
        }
        let keys = match name {
            "fur" => "thickness = 0.03\ndensity = 200",
            "grass" => "width = 0.05\nflatness = 0\ndensity = 60",
            // The stems of letters are steps, too.
            "height-map" => "softness = 0.1",
            _ => "",
        };
        let volume = recipe_of(name, keys).build().unwrap();
        for axis in 0..2 {
            let right = seam(&volume, axis, 127);
            assert!(right <= 1.1, "{name}: a seam of {right} across axis {axis}");
            // Two wrong places, since letters have a margin in one of them, too.
            let wrong = seam(&volume, axis, 70).max(seam(&volume, axis, 96));
            assert!(wrong > 1.5, "{name}: a border in the wrong place gives only {wrong} across axis {axis}");
        }
    }
}

/// The links of a chain go on across the border, and half a link away nothing fits.
#[test]
fn a_chain_has_no_end() {
    let text = "recipe = \"figure\"\nfigure = \"chain\"\nheight = 0.4\nrows = 2";
    let volume = recipe::parse("test", text).unwrap().build().unwrap();
    assert!(seam(&volume, 0, 127) <= 1.1);
    assert!(seam(&volume, 0, 96) > 1.5, "a border in the wrong place is not seen");
}

/// However small its links are, a chain has all of them: the parts of a slice that are drawn together may hold several periods.
#[test]
fn a_chain_of_small_links_misses_none() {
    let (links, texels) = (32, 4); // pairs of links on the tile, and texels a pair
    // The height at which so many fit in a row.
    let text = "recipe = \"figure\"\nfigure = \"chain\"\nheight = 0.01165";
    let size = [links * texels, 1024, 4];
    let volume = recipe::parse("test", text).unwrap().build_with_size(size).unwrap();
    let row = |u: u32| -> f32 {
        let all = (0..size[1]).flat_map(|v| (0..size[2]).map(move |w| [u, v, w]));
        all.map(|at| volume.texel(at)[3]).sum()
    };
    let rows: Vec<f32> = (0..size[0]).map(row).collect();
    for (u, row) in rows.iter().enumerate() {
        // Of f32 places on the tile alone.
        let first = rows[u % texels as usize];
        assert!(
            (row - first).abs() <= 1e-3 * first && *row > 0.0,
            "{row} at {u}, {first} in the first pair: {rows:?}"
        );
    }
}

/// Cut off by the border of the tile and continued on its other side is the same as moved.
#[test]
fn figures_go_on_across_the_border() {
    let figure = |keys: &str| {
        let text = format!("recipe = \"figure\"\nheight = 0.6\n{keys}");
        recipe::parse("test", &text).unwrap().build_with_size([32, 32, 16]).unwrap()
    };
    // The second row is shifted by half a figure, which is half a tile: across the border.
    let volume = figure("rows = 2");
    let mass = |rows: std::ops::Range<u32>, columns: std::ops::Range<u32>| -> f32 {
        let texels = (0..16).flat_map(|w| rows.clone().map(move |v| (v, w)));
        let sum = |(v, w): (u32, u32)| columns.clone().map(|u| volume.texel([u, v, w])[3]).sum::<f32>();
        texels.map(sum).sum()
    };
    let [first, second] = [0..16, 16..32].map(|rows| mass(rows, 0..32));
    assert!(first > 50.0 && (first - second).abs() < 0.02 * first, "{first} and {second}");
    assert!((mass(16..32, 0..8) - mass(16..32, 24..32)).abs() < 0.02 * first, "both halves are there");
    assert!(mass(16..32, 12..20) < 0.01 * first, "nothing is where it was shifted from");
}

#[test]
fn a_uniform_medium_has_the_opacity_that_is_asked_for_across_the_shell() {
    let volume = shipped("uniform").build().unwrap();
    assert_sound(&volume, "uniform");
    let alpha = f64::from(volume.texels[0][3]);
    assert!(volume.texels.iter().all(|texel| *texel == volume.texels[0]));
    assert!((1.0 - (1.0 - alpha).powi(32) - 0.7).abs() < 1e-5, "{alpha}");
    let solid = recipe::parse("test", "recipe = \"uniform\"\nalpha = 1").unwrap();
    assert_eq!(solid.build_with_size([1, 2, 3]).unwrap().texels[5][3], 1.0);
}

#[test]
fn overrides_replace_and_add_values() {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("volumes/fur.toml");
    let load = |overrides: &[&str]| {
        let overrides: Vec<_> = overrides.iter().map(|&text| text.to_owned()).collect();
        recipe::load_with(&path, &overrides)
    };
    let recipe = load(&["size = [4, 4, 2], seed = 7", "height=0.5", "seed=8"]).unwrap();
    let header = recipe.header();
    assert_eq!((header.size, header.seed, header.height), ([4, 4, 2], 8, 0.5));
    assert!(load(&["root_colour=#ff0000"]).is_ok(), "a bare word is a string");
    assert!(matches!(load(&["length"]), Err(Error::Usage { .. })));
    assert!(matches!(load(&["length = 2"]), Err(Error::Text { .. })));
    assert!(matches!(load(&["lenght = 0.5"]), Err(Error::Text { .. })));
}

/// docs/volumes.md has a table of all keys for every recipe, and a picture that is there and small.
#[test]
fn every_key_is_documented() {
    const DOCUMENTATION: &str = include_str!("../docs/volumes.md");
    let header = ["recipe", "size", "seed", "height"];
    let (_, common) = DOCUMENTATION.split_once("\n## Recipes").unwrap();
    assert!(header.iter().all(|key| common.contains(&format!("\n| `{key}` |"))));
    for name in NAMES.into_iter().chain(["uniform"]) {
        let (_, section) = DOCUMENTATION.split_once(&format!("\n### `{name}`\n")).unwrap();
        let section = section.split("\n##").next().unwrap();
        let text = format!("recipe = \"{name}\"\nunknown_key = 1");
        let Err(Error::Text { help, .. }) = recipe::parse("test", &text) else {
            panic!("{name} takes any key")
        };
        let keys = help.unwrap();
        let (_, keys) = keys.rsplit_once(" and ").unwrap();
        for key in keys.split(", ") {
            assert!(section.contains(&format!("\n| `{key}` |")), "{name}: {key}");
        }
        assert_eq!(
            section.matches("\n| `").count(),
            keys.split(", ").count(),
            "{name}: keys that it does not have"
        );
        let picture = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(format!("docs/recipes/{name}.png"));
        let bytes = std::fs::metadata(&picture).unwrap_or_else(|error| panic!("{name}: {error}")).len();
        assert!(
            section.contains(&format!("(recipes/{name}.png)")) && bytes < 150_000,
            "{name}: {bytes} bytes"
        );
    }
}

#[test]
fn hardly_any_texels_are_enough() {
    for name in NAMES {
        for size in [[1, 1, 1], [1, 7, 2], [5, 1, 1], [2, 3, 9]] {
            assert_sound(&shipped(name).build_with_size(size).unwrap(), name);
        }
    }
}

#[test]
fn extreme_keys_make_sound_volumes() {
    for (name, keys) in [
        ("fog", "depth = 100\nscale = 64\noctaves = 10\ncontrast = 1\nswirl = 2\nreach = 1\nheight = 4"),
        ("fog", "depth = 0\nscale = 1\noctaves = 1\ncontrast = 0\nswirl = 0\nreach = 0.05\nheight = 0.01"),
        ("clouds", "coverage = 1\ndepth = 200\nscale = 64\nbillows = 256\nsoftness = 1\nbottom = 0.9"),
        ("clouds", "coverage = 0\ndepth = 0\nscale = 1\nbillows = 1\nsoftness = 0\nbottom = 0"),
        ("fur", "density = 2000\nlength_variation = 1\nthickness = 0.05\ncurl = 0.2\nlean = 4\nclumping = 1"),
        ("fur", "density = 0"),
        (
            "fur",
            "length = 0.05\nthickness = 0.0005\ntaper = 1\ncurl = 0\nlean = 0\nclumps = 256\nopacity = 0.98",
        ),
        ("chain-mail", "rings = 128\nwire = 0.22\nvariation = 1\ntarnish = 1\nshine = 1\nheight = 4"),
        ("chain-mail", "rings = 1\nwire = 0.08\nshine = 0\nocclusion = 1\nbacking = 0\nheight = 0.01"),
        (
            "scales",
            "scales = 128\noverlap = 5\noutline = 8\nthickness = 1\nlift = 1\ndome = 1\nridge = 2\nshine = 1",
        ),
        (
            "scales",
            "scales = 1\noverlap = 2.2\noutline = 1\nthickness = 0.05\nlift = 0\ndome = 0\nheight = 0.01",
        ),
        (
            "ellipsoids",
            "count = 2000\nlargest = 0.3\nsmallest = 0.005\nelongation = 0.9\nrim = 1\nheight = 4",
        ),
        (
            "ellipsoids",
            "largest = 0.01\nsmallest = 0.3\nalpha = 0.9999999\nmedium_alpha = 0.9999999\nmedium_contrast = 1",
        ),
        ("ellipsoids", "count = 0\nalpha = 0\nmedium_alpha = 0\nheight = 0.01"),
        (
            "grass",
            "density = 3000\nlength_variation = 1\nwidth = 0.05\nflatness = 0.9\ntaper = 1\nbend = 85\nwind = 1",
        ),
        (
            "grass",
            "length = 0.05\nwidth = 0.001\ntaper = 0\nbend = 0\nwind = 0\ntufts = 256\ntufting = 1\nheight = 0.01",
        ),
        (
            "figure",
            "rows = 64\nmargin = 0.4\nvariation = 0.9\nturn_variation = 180\nsunk = 0.9\nflatness = 0.9",
        ),
        ("figure", "lying = true\nturn = 360\nalpha = 0\npaint = 0\nocclusion = 1\nheight = 4"),
        ("figure", "figure = \"chain\"\nmargin = 0\nheight = 0.01"),
        ("grass", "density = 0"),
        ("height-map", "black = 0.95\nwhite = 0.02\nsoftness = 0.25\ngrain = 1\nocclusion = 1"),
        ("height-map", "black = 0.5\nwhite = 0.5\nheight = 0.01"),
        (
            "trees",
            "count = 500\ncrown = 0.3\nvariation = 0.9\noverlap = 0.9\nblobs = 100\nraggedness = 1\ntrunk = 0.7",
        ),
        (
            "trees",
            "count = 3\ncrown = 0.01\nconifers = 1\nblobs = 1\nraggedness = 0\ntrunk = 0\nheight = 0.01",
        ),
        ("trees", "count = 0\nheight = 4"),
        ("weave", "pairs = 256\nwidth = 1\nroundness = 1\ntwist = 256\nfibres = 1\nvariation = 1"),
        ("weave", "pairs = 1\nwidth = 0.1\nroundness = 0.1\ntwist = 0\nheight = 0.01"),
        (
            "rocks",
            "largest = 0.3\nsmallest = 0.005\noverlap = 0.9\nflatness = 0.9\nangularity = 1\nroughness = 0.5",
        ),
        ("rocks", "largest = 0.01\nsmallest = 0.3\nflatness = 0\nground = 0.9\nheight = 0.01"),
        ("rocks", "throws = 0\nground = 0"),
    ] {
        assert_sound(&small(name, keys), &format!("{name}: {keys}"));
    }
}

#[test]
fn absurd_sizes_are_refused_before_anything_is_allocated() {
    for size in ["[0, 128, 32]", "[128, 128, 0]", "[2147483648, 2147483648, 2147483648]", "[65536, 4097, 1]"]
    {
        assert_underlined("recipe = \"fog\"\nsize = ", size, "", "size");
    }
    let fog = shipped("fog");
    for size in [[0, 1, 1], [1 << 31, 1 << 31, 1 << 31], [u32::MAX, 1, 1]] {
        assert!(matches!(fog.build_with_size(size), Err(Error::Usage { .. })), "{size:?}");
    }
}

/// Checks that `before + spot + after` is refused with a message that has `words`, and that the spot is
/// what is underlined.
fn assert_underlined(before: &str, spot: &str, after: &str, words: &str) {
    let text = format!("{before}{spot}{after}");
    match recipe::parse("nice.toml", &text) {
        Err(Error::Text { span, message, .. }) => {
            assert!(message.contains(words) && message.contains("nice.toml"), "{text}: {message}");
            assert_eq!(&text[span.offset()..span.offset() + span.len()], spot, "{message}");
        }
        other => panic!("{text}: {other:?}"),
    }
}

#[test]
fn mistakes_are_underlined() {
    let fur = "recipe = \"fur\"\nseed = 3\n";
    assert_underlined("recipe = \"figure\"\nfigure = ", "\"cat\"", "", "there is no figure \"cat\"");
    assert_underlined(fur, "lenght", " = 0.5\n", "lenght");
    assert_underlined(&format!("{fur}length = "), "1.5", "\ncurl = 0\n", "`length`: 1.5 is not in 0.05..=1");
    assert_underlined(&format!("{fur}length = "), "nan", "", "`length`");
    assert_underlined(&format!("{fur}length = "), "\"long\"", "", "`length`: invalid type");
    assert_underlined(&format!("{fur}density = "), "-4", "", "`density`: invalid value");
    assert_underlined(&format!("{fur}density = "), "1.5", "", "`density`");
    assert_underlined(&format!("{fur}tip_colour = "), "\"gold\"", "", "`tip_colour`: invalid value");
    assert_underlined(&format!("{fur}tip_colour = [1, "), "-1", ", 0]", "`tip_colour`: invalid value");
    assert_underlined(&format!("{fur}tip_colour = "), "[1, 0, 0, 1]", "", "`tip_colour`: invalid length");
    assert_underlined(&format!("{fur}height = "), "9", "", "`height`");
    assert_underlined("recipe = ", "\"moss\"", "", "there is no recipe \"moss\"");
    for size in ["[1, 2]", "[1, 2, 3, 4]"] {
        assert_underlined("recipe = \"fog\"\nsize = ", size, "", "expected a list of 3");
    }
    assert_underlined("recipe = \"fog\"\nseed = ", "-1", "", "`seed`");
    assert_underlined("", "", "seed = 1", "`recipe`");
}

#[test]
fn an_image_is_relative_to_its_recipe_and_must_be_one() {
    let folder = tempfile::tempdir().unwrap();
    let toml = folder.path().join("relief.toml");
    let load = |image: &str| {
        std::fs::write(&toml, format!("recipe = \"height-map\"\nimage = \"{image}\"")).unwrap();
        recipe::load(&toml)
    };
    std::fs::write(folder.path().join("text.png"), "no picture").unwrap();
    for image in ["nowhere.png", "text.png", "."] {
        let Err(Error::Input { path, .. }) = load(image) else { panic!("{image} is taken") };
        assert_eq!(path, folder.path().join(image));
    }
    assert!(matches!(load(""), Err(Error::Text { .. })));

    // Black on the left, white on the right: as high as the keys say, as long as no edge is near.
    let image = image::GrayImage::from_fn(8, 8, |x, _| image::Luma([if x < 4 { 0 } else { 255 }]));
    image.save(folder.path().join("step.png")).unwrap();
    let volume = load("step.png").unwrap().build_with_size([32, 32, 20]).unwrap();
    for (u, height) in [(8, 0.3), (24, 0.9)] {
        let filled: f32 = (0..20).map(|w| volume.texel([u, 16, w])[3]).sum();
        // A smooth edge has its middle where the sharp one is, but for the steps of the grid.
        assert!((filled / 20. - height).abs() < 0.5 / 20., "{filled} of 20 at {height}");
    }
}

#[test]
fn help_lists_the_keys_and_the_recipes() -> Result<()> {
    let help = |text: &str| match recipe::parse("nice.toml", text) {
        Err(Error::Text { help, .. }) => help.unwrap_or_default(),
        other => panic!("{text}: {other:?}"),
    };
    assert!(help("recipe = \"fur\"\nhair = 1").contains("density"));
    assert!(NAMES.iter().all(|name| help("recipe = \"\"").contains(name)));
    assert!(matches!(recipe::load("no/such.toml"), Err(Error::Input { .. })));
    Ok(())
}
