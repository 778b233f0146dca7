//! The report: one HTML page that needs nothing else, neither scripts nor other files.

use std::fmt::Write;

use super::picture::{ErrorMap, data_uri, error_map, thumbnail};
use super::{error_names, error_title, plot};
use crate::bench::measure::Pictures;
use crate::bench::results::{Curve, Point, SceneResults};
use crate::bench::{Environment, Results};
use crate::frame::{Backdrop, Image};

const STYLE: &str = include_str!("style.css");

/// The page, with the pictures of each scene.
pub fn page(results: &Results, pictures: &[Pictures]) -> String {
    let environment = &results.environment;
    let mut page = head(&format!("Time against error: {}", escape(&results.sweep.name)));
    let _ = write!(
        page,
        "<header><h1>Time against error</h1>\n<p>{name}, {date}, {device}: frames timed in {runs} interleaved rounds, \
         errors against the f64 reference.</p></header>\n",
        name = escape(&results.sweep.name),
        date = escape(&environment.date),
        device = escape(&environment.device),
        runs = results.sweep.runs,
    );
    for (scene, pictures) in results.scenes.iter().zip(pictures) {
        section(&mut page, scene, pictures, results.sweep.error_every);
    }
    page += &measured_on(environment, &results.sweep.define);
    page + "<section class=\"notes\">\n<h2>How to read it</h2>\n\
        <p>Time is the wall time of a whole frame, sort and readback included, once the scene is loaded; a first frame is \
        left out. In each round every point of a scene is timed once, so that a machine that drifts hurts all alike. The \
        95th percentile of less than 20 runs is the slowest.</p>\n\
        <p>Error is that of linear premultiplied RGBA, where white is 1. A step is the distance between samples in texels; \
        samples are those in each tetrahedron. Full marks are on the Pareto front: no other point is as fast and as \
        accurate. The order is the slope of log RMSE over log distance between samples, fitted where the RMSE is above \
        1e-6, below which it is rounding.</p>\n</section>\n</body>\n</html>\n"
}

/// The beginning of a page with that title, up to its body.
pub fn head(title: &str) -> String {
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width\">\n<meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n"
    )
}

/// The section that tells the machine, the program, and what was laid over every scene.
pub fn measured_on(environment: &Environment, define: &[String]) -> String {
    let mut section = "<section>\n<h2>Measured on</h2>\n<table class=\"facts\">\n".to_owned();
    let defined = (!define.is_empty()).then(|| ("set in every scene", define.join("; ")));
    for (name, value) in environment.rows().into_iter().chain(defined) {
        let _ = writeln!(section, "<tr><th scope=\"row\">{name}</th><td>{}</td></tr>", escape(&value));
    }
    section + "</table>\n</section>\n"
}

/// Text that stands in HTML as it is.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn section(page: &mut String, scene: &SceneResults, pictures: &Pictures, error_every: u32) {
    let thinned = match error_every {
        1 => String::new(),
        n => format!(" (errors and pictures: one of {n} × {n})"),
    };
    let reused = if scene.reference_reused { ", from the cache" } else { "" };
    let _ = writeln!(
        page,
        "<section>\n<h2>{}</h2>\n<p>{} × {} pixels{thinned}, {} tetrahedra; the reference took {:.1} s{reused}.</p>",
        escape(&scene.name()),
        scene.width,
        scene.height,
        scene.tetrahedra,
        1e-3 * scene.reference_milliseconds
    );
    *page += "<div class=\"columns\">\n<figure>\n";
    *page += &plot::svg(scene);
    *page += "<figcaption class=\"legend\">\n";
    for (index, curve) in scene.curves.iter().enumerate() {
        let _ = writeln!(page, "<span>{} {}</span>", plot::key(index), legend(curve));
    }
    *page += "<span><svg class=\"wide key\" viewBox=\"-16 -8 32 16\"><path class=\"front\" d=\"M-16-6H0V6H16\"/></svg> \
              Pareto front</span>\n</figcaption>\n</figure>\n";
    table(page, scene);
    *page += "</div>\n";
    gallery(page, scene, pictures);
    stages(page, scene);
    *page += "</section>\n";
}

/// What a curve is, and its order of convergence.
fn legend(curve: &Curve) -> String {
    let name = format!("{}, {} plan", escape(&curve.method), escape(&curve.plan));
    let unit = match curve.plan.as_str() {
        "default" => " (step in texels)",
        "paper" => " (samples in a tetrahedron)",
        _ => "",
    };
    match curve.order {
        Some(order) => format!("{name}{unit}: <b>order {order:.2}</b>, of {} points", curve.order_points),
        None => format!("{name}{unit}"),
    }
}

fn table(page: &mut String, scene: &SceneResults) {
    let errors = scene.points.first().map_or(Vec::new(), error_names);
    *page += "<table>\n<thead><tr><th>point</th><th>median (ms)</th><th>95 % (ms)</th>";
    for name in &errors {
        let _ = write!(page, "<th>{}</th>", escape(error_title(name)));
    }
    *page += "</tr></thead>\n<tbody>\n";
    for (index, curve) in scene.curves.iter().enumerate() {
        for point in scene.points_of(curve) {
            let fill = if point.pareto { "full" } else { "hollow" };
            let _ = write!(
                page,
                "<tr><th scope=\"row\"><svg class=\"key\" viewBox=\"-8 -8 16 16\"><g class=\"{}\"><g class=\"mark \
                 {fill}\">{}</g></g></svg> {}</th><td>{:.1}</td><td>{:.1}</td>",
                plot::class(index),
                plot::shape(index),
                point.setting.level(),
                point.time.median,
                point.time.p95
            );
            for name in &errors {
                let _ = write!(page, "<td>{}</td>", error_text(point, name));
            }
            *page += "</tr>\n";
        }
    }
    *page += "</tbody>\n</table>\n";
}

fn error_text(point: &Point, name: &str) -> String {
    let value = point.error(name);
    match name {
        _ if !value.is_finite() => "∞".to_owned(),
        "psnr" => format!("{value:.1}"),
        _ => format!("{value:.1e}"),
    }
}

fn gallery(page: &mut String, scene: &SceneResults, pictures: &Pictures) {
    let reference = thumbnail(&pictures.reference);
    *page += "<div class=\"gallery\">\n";
    let shown = |page: &mut String, image: &Image, backdrop: &Backdrop, caption: &str| {
        let _ = writeln!(
            page,
            "<figure><img src=\"{}\" width=\"{}\" height=\"{}\" alt=\"{caption}\"><figcaption>{caption}</figcaption>",
            data_uri(image, backdrop),
            image.width,
            image.height
        );
    };
    shown(page, &reference, &pictures.backdrop, "reference");
    *page += "</figure>\n";
    for ((index, image), title) in scene
        .best_and_worst()
        .into_iter()
        .zip(&pictures.best_and_worst)
        .zip(["most accurate", "least accurate"])
    {
        let point = &scene.points[index];
        let quality = point.setting.march;
        let image = thumbnail(image);
        shown(page, &image, &pictures.backdrop, &format!("{title}: {quality}"));
        *page += "</figure>\n";
        let ErrorMap { image: map, range } = error_map(&image, &reference, pictures.backdrop.flat_colour());
        shown(page, &map, &Backdrop::default(), &format!("its error in luminance: {quality}"));
        let _ = writeln!(
            page,
            "<div class=\"range\"><span>−{range:e} darker</span><i></i><span>brighter +{range:e}</span></div></figure>"
        );
    }
    *page += "</div>\n";
}

/// Medians of the stages of a frame, their parts left out.
fn stages(page: &mut String, scene: &SceneResults) {
    let mut names: Vec<&str> = Vec::new();
    for stage in scene.points.iter().flat_map(|point| &point.stages) {
        if !stage.name.contains('.') && !names.contains(&stage.name.as_str()) {
            names.push(&stage.name);
        }
    }
    *page += "<details>\n<summary>Time by stage</summary>\n<table>\n<thead><tr><th>point</th>";
    for name in &names {
        let _ = write!(page, "<th>{} (ms)</th>", escape(name));
    }
    *page += "</tr></thead>\n<tbody>\n";
    for point in &scene.points {
        let setting = &point.setting;
        let _ = write!(page, "<tr><th scope=\"row\">{}, {}</th>", escape(&setting.method), setting.march);
        for name in &names {
            let stage = point.stages.iter().find(|stage| stage.name == *name);
            let _ = match stage {
                Some(stage) => write!(page, "<td>{:.1}</td>", stage.time.median),
                None => write!(page, "<td></td>"),
            };
        }
        *page += "</tr>\n";
    }
    *page += "</tbody>\n</table>\n</details>\n";
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::results::tests::results;

    fn pictures() -> Pictures {
        let reference = Image::new(2, 2);
        let mut wrong = reference.clone();
        wrong.rgba[1] = [0.3; 4];
        Pictures { best_and_worst: [reference.clone(), wrong], reference, backdrop: Backdrop::default() }
    }

    #[test]
    fn a_page_needs_nothing_else() {
        let page = page(&results(), &[pictures()]);
        for outside in ["<script", "http:", "https:", "<link", "@import", "url("] {
            assert!(!page.contains(outside), "{outside}");
        }
        assert_eq!(page.matches("src=\"data:image/png;base64,").count(), 5);
        assert_eq!(page.matches("src=").count(), 5);
        assert!(page.contains("prefers-color-scheme: dark"));
    }

    #[test]
    fn all_that_was_measured_is_told() {
        let page = page(&results(), &[pictures()]);
        let parts = [
            "<b>order 2.00</b>, of 3 points",
            "paper plan (samples",
            "2.5e-3",
            "20.5",
            "a &lt;device&gt;",
            "1.2 s",
        ];
        for part in parts.into_iter().chain(["fog &amp; fur", "step 0.25", "1 sample", "+5e-1", "march (ms)"])
        {
            assert!(page.contains(part), "{part}");
        }
        assert!(!page.contains("a <device>"));
        for tag in ["section", "figure", "table", "tr", "svg", "g", "details", "div"] {
            let opened =
                page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
            assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
        }
    }
}
