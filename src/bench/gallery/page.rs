//! The page: all scenes at a glance, then each with its text, its times and its errors. It refers to the pictures beside it.

use std::fmt::Write;
use std::path::Path;

use super::results::{Drawn, Measured, Results, SceneResults, Verdict};
use crate::bench::report::html::{escape, head, measured_on};
use crate::frame::Report;

/// The page, with the text of each scene file that could be read.
pub fn page(results: &Results, texts: &[Option<String>]) -> String {
    let mut page = head("Gallery");
    let environment = &results.environment;
    let _ = write!(
        page,
        "<header><h1>Gallery</h1>\n<p>{}, {}: scenes by the <code>shell</code> method, a warm frame timed once, errors against \
         the f64 reference in a smaller picture of the same view.</p></header>\n",
        escape(&environment.date),
        escape(&environment.device)
    );
    overview(&mut page, results);
    let mut texts = texts.iter();
    let mut number = 0;
    for (group, scenes) in results.groups() {
        let _ = writeln!(page, "<section>\n<h2>{}</h2>", escape(&group));
        for scene in scenes {
            number += 1;
            article(&mut page, number, scene, texts.next().and_then(Option::as_deref));
        }
        page += "</section>\n";
    }
    page += &measured_on(environment, &[]);
    page + "<section class=\"notes\">\n<h2>How to read it</h2>\n<p>Load is the time from the scene file to a method that is \
        ready to render, the volume computed or read, filtered and uploaded. Frame is the wall time of a whole second frame, \
        sort and readback included. Error is that of linear premultiplied RGBA, where white is 1: backgrounds and exposure \
        have no part in it.</p>\n</section>\n</body>\n</html>\n"
}

/// Small pictures that lead to the large ones.
fn overview(page: &mut String, results: &Results) {
    *page += "<nav class=\"overview\">\n";
    for (number, scene) in (1..).zip(&results.scenes) {
        let _ = write!(page, "<a href=\"#scene-{number}\">");
        if let Some(drawn) = &scene.drawn {
            let _ = write!(page, "<img src=\"{}\" alt=\"\" loading=\"lazy\">", link(&drawn.picture));
        } else {
            *page += "<i></i>";
        }
        let mark = match scene.verdict {
            Verdict::Failed | Verdict::Broken => format!(" <b class=\"bad\">{}</b>", scene.verdict.told()),
            Verdict::Passed | Verdict::Unmeasured => String::new(),
        };
        let _ = writeln!(page, "<span>{}{mark}</span></a>", escape(&scene.name()));
    }
    *page += "</nav>\n";
}

fn article(page: &mut String, number: usize, scene: &SceneResults, text: Option<&str>) {
    let _ = writeln!(page, "<article id=\"scene-{number}\" class=\"scene\">");
    if let Some(Drawn { picture, width, height, .. }) = &scene.drawn {
        let link = link(picture);
        let _ = writeln!(
            page,
            "<figure><a href=\"{link}\"><img src=\"{link}\" width=\"{width}\" height=\"{height}\" alt=\"{}\"></a></figure>",
            escape(&scene.title)
        );
    }
    let _ = writeln!(page, "<div>\n<h3>{}</h3>", escape(&scene.title));
    for paragraph in scene.description.split("\n\n").filter(|paragraph| !paragraph.is_empty()) {
        let _ = writeln!(page, "<p>{}</p>", escape(paragraph));
    }
    if let Some(failure) = &scene.failure {
        let _ = writeln!(page, "<p class=\"bad\">It could not be rendered: {}</p>", escape(failure));
    }
    if let Some(drawn) = &scene.drawn {
        figures(page, scene.verdict, drawn);
        report(page, &drawn.report);
    }
    if let Some(text) = text {
        let name = escape(&scene.scene.display().to_string());
        let _ = writeln!(page, "<details><summary>{name}</summary>\n<pre>{}</pre></details>", escape(text));
    }
    *page += "</div>\n</article>\n";
}

/// Sizes, times and errors.
fn figures(page: &mut String, verdict: Verdict, drawn: &Drawn) {
    let mut rows = vec![
        ("size", format!("{} × {} pixels", drawn.width, drawn.height)),
        ("tetrahedra", drawn.tetrahedra.to_string()),
        ("load", format!("{:.0} ms", drawn.load_milliseconds)),
        ("frame", format!("{:.1} ms", drawn.frame_milliseconds)),
    ];
    if let Some(Measured { width, height, metrics, reference_milliseconds, reference_reused, .. }) =
        &drawn.error
    {
        let reused = if *reference_reused { ", from the cache" } else { "" };
        let seconds = 1e-3 * reference_milliseconds;
        rows.extend([
            ("compared", format!("{width} × {height} pixels; the reference took {seconds:.1} s{reused}")),
            ("RMSE", format!("{:.1e}, of at most {:.0e}", metrics.rmse, drawn.bound)),
            ("99.9 %", format!("{:.1e}", metrics.p999)),
            ("max", format!("{:.1e}", metrics.max)),
        ]);
    }
    *page += "<table class=\"facts\">\n";
    for (name, value) in rows {
        let bad = if name == "RMSE" && verdict == Verdict::Failed { " class=\"bad\"" } else { "" };
        let _ = writeln!(page, "<tr><th scope=\"row\">{name}</th><td{bad}>{value}</td></tr>");
    }
    *page += "</table>\n";
}

/// Stages, counts and what was skipped.
fn report(page: &mut String, report: &Report) {
    *page += "<details><summary>Frame report</summary>\n<div class=\"report\">\n<table>\n";
    for stage in &report.stages {
        let class = if stage.name.contains('.') { " class=\"part\"" } else { "" };
        let _ = writeln!(
            page,
            "<tr{class}><th scope=\"row\">{}</th><td>{:.2} ms</td></tr>",
            escape(&stage.name),
            stage.milliseconds
        );
    }
    *page += "</table>\n<table>\n";
    for (name, count) in &report.counts {
        let _ = writeln!(
            page,
            "<tr><th scope=\"row\">{}</th><td>{count}</td></tr>",
            escape(&name.replace('_', " "))
        );
    }
    *page += "</table>\n</div>\n";
    let list = |page: &mut String, title: &str, sentences: &[String]| {
        if !sentences.is_empty() {
            let items: String = sentences.iter().map(|text| format!("<li>{}</li>\n", escape(text))).collect();
            let _ = writeln!(page, "<p>{title}</p>\n<ul>\n{items}</ul>");
        }
    };
    list(page, "Skipped:", &report.skipped);
    list(page, "Warnings:", &report.warnings);
    *page += "</details>\n";
}

/// A path as a relative address.
fn link(path: &Path) -> String {
    let mut link = String::new();
    for byte in path.to_string_lossy().bytes() {
        match byte {
            b'a'..=b'z' | b'A'..=b'Z' | b'0'..=b'9' | b'-' | b'_' | b'.' | b'/' => link.push(byte.into()),
            _ => {
                let _ = write!(link, "%{byte:02X}");
            }
        }
    }
    link
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::gallery::results::tests::results;

    #[test]
    fn all_that_was_found_is_told() {
        let texts = [Some("# <Fog>\n".to_owned()), None, None, Some("[shel]".to_owned())];
        let page = page(&results(), &texts);
        let parts = [
            "<h2>a</h2>",
            "<h3>Fog &amp; fur</h3>",
            "Thin &lt;b&gt;.",
            "src=\"a/fog%20%26%20fur.png\"",
            "16 × 12 pixels",
            "150 ms",
            "20.2 ms",
            "1.0e-3, of at most 5e-3",
            "<td class=\"bad\">2.0e-2",
            "17.50 ms",
            "tetrahedra drawn",
            "&lt;beside&gt;",
            "unknown key `shel`",
            "<pre># &lt;Fog&gt;",
            "a &lt;device&gt;",
        ];
        for part in parts {
            assert!(page.contains(part), "{part}");
        }
        assert!(page.find("a/lone.toml") < page.find("b/torn.toml"));
        for tag in ["section", "article", "figure", "table", "tr", "details", "div", "nav", "ul", "a"] {
            let opened =
                page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
            assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
        }
        for outside in ["<script", "http:", "https:", "<link", "@import", "url("] {
            assert!(!page.contains(outside), "{outside}");
        }
        for number in 1..=4 {
            assert!(
                page.contains(&format!("href=\"#scene-{number}\""))
                    && page.contains(&format!("id=\"scene-{number}\""))
            );
        }
    }
}
