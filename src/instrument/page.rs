//! The results as one HTML page that needs nothing else.

use std::fmt::Write;
use std::io::Write as _;
use std::path::Path;

use super::faults::Places;
use super::plot::{Curve, svg};
use super::results::{FrameResults, Results, rounded_down};
use super::walk::Outcome;
use crate::Result;
use crate::bench::file;
use crate::bench::report::html::{escape, head};
use crate::bench::report::picture::data_uri;
use crate::frame::Backdrop;

/// Rows of tetrahedra and pairs that are told.
const ROWS: usize = 40;

const PAGE: &str = "index.html";
const RESULTS: &str = "results.json";

/// Whether [`write()`] can write into a folder, which is made where it is missing.
///
/// # Errors
/// [`Error::Output`](crate::Error::Output).
pub fn check_writable(folder: &Path) -> Result<()> {
    file::check_writable(&folder.join(PAGE))
}

/// Writes the page and the results, each whole or not at all.
///
/// # Errors
/// [`Error::Output`](crate::Error::Output).
pub fn write(folder: &Path, outcome: &Outcome) -> Result<()> {
    let results = serde_json::to_string_pretty(&outcome.results).expect("numbers and names alone");
    for (name, text) in [(RESULTS, results), (PAGE, page(outcome))] {
        file::write_whole(&folder.join(name), |file| file.write_all(text.as_bytes()))?;
    }
    Ok(())
}

/// The page.
pub fn page(outcome: &Outcome) -> String {
    let results = &outcome.results;
    let scene = escape(&results.scene.display().to_string());
    let mut page = head(&format!("Animation check: {scene}"));
    let frames = &results.frames;
    let _ = writeln!(
        page,
        "<header><h1>Animation check: {scene}</h1>\n<p>{} frames, {} to {}, at {} frames a second; {} tetrahedra; {} × {} \
         pixels on {}.</p></header>",
        frames.len(),
        frames[0].frame,
        frames[frames.len() - 1].frame,
        results.rate,
        results.tetrahedra,
        results.width,
        results.height,
        escape(&results.device)
    );
    verdict(&mut page, results);
    curves(&mut page, results);
    pictures(&mut page, outcome);
    page += "<section>\n<h2>Frame by frame</h2>\n<details open><summary>Table</summary>\n";
    table(&mut page, frames);
    page += "</details>\n";
    places(&mut page, frames);
    page + "</section>\n<section class=\"notes\">\n<h2>How to read it</h2>\n\
        <p>Stretch is the singular values of the deformation since the first frame: 1 is none, and what moves as a rigid body \
        has none. Shear is the greatest departure from a right angle. The thickness that is safe is a factor on that in \
        force, up to which no tetrahedron is inverted. Pairs intersect where their interiors do, by exact signs; what merely \
        touches is none. A pixel pops that changes more since the frame before than the motion of what is seen in it \
        explains.</p>\n</section>\n</body>\n</html>\n"
}

fn verdict(page: &mut String, results: &Results) {
    *page += "<section>\n<h2>Verdict</h2>\n";
    let bad: Vec<(&FrameResults, Vec<String>)> = results
        .frames
        .iter()
        .map(|frame| (frame, frame.faults()))
        .filter(|(_, faults)| !faults.is_empty())
        .collect();
    if bad.is_empty() {
        *page += "<p>No frame has a fault.</p>\n";
    } else {
        let _ = writeln!(
            page,
            "<p class=\"bad\">{} of {} frames have faults.</p>\n<ul>",
            bad.len(),
            results.frames.len()
        );
        for (frame, faults) in bad.iter().take(ROWS) {
            let _ = writeln!(page, "<li>frame {}: {}</li>", frame.frame, faults.join(", "));
        }
        if bad.len() > ROWS {
            let _ = writeln!(page, "<li>and {} more</li>", bad.len() - ROWS);
        }
        *page += "</ul>\n";
    }
    let _ = writeln!(page, "<p>{}</p>\n</section>", escape(&results.told_fold()));
}

fn curves(page: &mut String, results: &Results) {
    let numbers: Vec<u32> = results.frames.iter().map(|frame| frame.frame).collect();
    let curve = |name, value: &dyn Fn(&FrameResults) -> Option<f64>| Curve {
        name,
        values: results.frames.iter().map(value).collect(),
    };
    let count = |name, count: fn(&FrameResults) -> u64| curve(name, &|frame| Some(count(frame) as f64));
    let stage = |name, prefix: &'static str| {
        curve(name, &|frame| {
            let of =
                frame.stages.iter().filter(|stage| stage.name == prefix || stage.name.starts_with(prefix));
            Some(
                of.filter(|stage| prefix == "load." || !stage.name.contains('.'))
                    .map(|stage| stage.milliseconds)
                    .sum(),
            )
        })
    };
    let plots = [
        (
            "Stretch",
            vec![
                curve("greatest", &|frame| Some(frame.stretch.greatest)),
                curve("root mean square", &|frame| Some(frame.stretch.rms)),
                curve("least", &|frame| Some(frame.stretch.least)),
            ],
        ),
        ("Shear, in degrees", vec![curve("greatest", &|frame| Some(frame.stretch.shear_degrees))]),
        (
            "Tetrahedra",
            vec![
                count("inverted", |frame| frame.faults.inverted.count),
                count("slivers", |frame| frame.faults.slivers.count),
                count("pairs that intersect", |frame| frame.overlaps.pairs),
            ],
        ),
        (
            "Order",
            vec![
                count("violations", |frame| frame.order.violations),
                count("cycles", |frame| frame.order.cycles),
                count("tetrahedra in cycles", |frame| frame.order.cycle_members),
            ],
        ),
        (
            "Pixels that pop",
            vec![curve("pixels", &|frame| frame.pops.as_ref().map(|pops| pops.pixels as f64))],
        ),
        (
            "Thickness, in world units",
            vec![
                curve("greatest", &|frame| Some(frame.thickness.greatest)),
                curve("mean", &|frame| Some(frame.thickness.mean)),
                curve("least", &|frame| Some(frame.thickness.least)),
            ],
        ),
        ("Thickness that is safe, as a factor", vec![curve("factor", &|frame| frame.fold.factor)]),
        (
            "Time, in ms",
            vec![
                stage("loading", "load."),
                stage("order", "order"),
                stage("upload", "upload"),
                stage("march", "march"),
            ],
        ),
    ];
    *page += "<section>\n<h2>Curves</h2>\n<div class=\"curves\">\n";
    for (title, curves) in plots {
        *page += &svg(title, &numbers, &curves);
    }
    *page += "</div>\n</section>\n";
}

fn pictures(page: &mut String, outcome: &Outcome) {
    *page += "<section>\n<h2>The worst frames</h2>\n<div class=\"overview\">\n";
    for worst in &outcome.worst {
        let _ = writeln!(
            page,
            "<figure><img src=\"{}\" alt=\"frame {}\"><figcaption>frame {}: {}</figcaption></figure>",
            worst.picture, worst.frame, worst.frame, worst.what
        );
    }
    let _ = writeln!(
        page,
        "<figure><img src=\"{}\" alt=\"stretch\" style=\"aspect-ratio:auto\"><figcaption>stretch in frame {}</figcaption>\
         </figure>\n</div>\n</section>",
        data_uri(&outcome.heatmap, &Backdrop::default()),
        outcome.results.most_deformed
    );
}

fn table(page: &mut String, frames: &[FrameResults]) {
    *page += "<table>\n<thead><tr><th>frame</th><th>inverted</th><th>slivers</th><th>intersecting</th><th>violations</th>\
              <th>cycles</th><th>pops</th><th>least stretch</th><th>greatest</th><th>shear</th><th>thickness</th>\
              <th>safe</th></tr></thead>\n<tbody>\n";
    for frame in frames {
        let class = if frame.faults().is_empty() { "" } else { " class=\"bad\"" };
        let _ = write!(page, "<tr><th scope=\"row\"{class}>{}</th>", frame.frame);
        for cell in cells(frame) {
            let _ = write!(page, "<td>{cell}</td>");
        }
        *page += "</tr>\n";
    }
    *page += "</tbody>\n</table>\n";
}

/// What a row of the table says beside the frame's number.
pub fn cells(frame: &FrameResults) -> [String; 11] {
    let count = |count: u64| count.to_string();
    [
        count(frame.faults.inverted.count),
        count(frame.faults.slivers.count),
        count(frame.overlaps.pairs),
        count(frame.order.violations),
        count(frame.order.cycles),
        frame.pops.as_ref().map_or("–".to_owned(), |pops| pops.pixels.to_string()),
        format!("{:.4}", frame.stretch.least),
        format!("{:.4}", frame.stretch.greatest),
        format!("{:.2}°", frame.stretch.shear_degrees),
        format!("{:.4}", frame.thickness.mean),
        frame.fold.factor.map_or("any".to_owned(), |factor| format!("× {}", rounded_down(factor))),
    ]
}

/// Which tetrahedra and pairs, and where.
fn places(page: &mut String, frames: &[FrameResults]) {
    let at = |[x, y, z]: [f64; 3]| format!("({x:.4}, {y:.4}, {z:.4})");
    let mut rows = Vec::new();
    for frame in frames {
        let mut tell = |what: &str, places: &Places| {
            rows.extend(places.first.iter().map(|place| {
                [
                    frame.frame.to_string(),
                    what.to_owned(),
                    place.tetrahedron.to_string(),
                    place.triangle.to_string(),
                    at(place.centroid),
                ]
            }));
        };
        tell("inverted", &frame.faults.inverted);
        tell("sliver", &frame.faults.slivers);
        rows.extend(frame.overlaps.first.iter().map(|pair| {
            let [a, b] = pair.tetrahedra;
            [
                frame.frame.to_string(),
                "intersect".to_owned(),
                format!("{a}, {b}"),
                format!("{}, {}", a / 3, b / 3),
                at(pair.at),
            ]
        }));
    }
    if rows.is_empty() {
        return;
    }
    let _ = writeln!(
        page,
        "<details><summary>Which, and where: the first {}</summary>\n<table>\n<thead><tr><th>frame</th><th>what</th>\
         <th>tetrahedra</th><th>base triangles</th><th>where</th></tr></thead>\n<tbody>",
        rows.len().min(5 * ROWS)
    );
    for row in rows.into_iter().take(5 * ROWS) {
        let _ = writeln!(page, "<tr>{}</tr>", row.map(|cell| format!("<td>{cell}</td>")).concat());
    }
    *page += "</tbody>\n</table>\n</details>\n";
}
