//! The results for spreadsheets and for people.

use std::fmt::Write;

use super::results::{FRAME, Growth, Point, Results, SeriesResults};
use crate::bench::report::csv::quoted;
use crate::bench::report::html::{escape, head, measured_on};
use crate::bench::report::plot;

/// Stages that are drawn beside whole frames.
const DRAWN: [&str; 5] = [FRAME, "load.shell", "order", "see", "march"];

/// CSV (RFC 4180): one line a series, size and stage.
pub fn csv(results: &Results) -> String {
    let mut lines = "series,of,size,stage,median_ms,p95_ms,memory_bytes\r\n".to_owned();
    for series in &results.series {
        for point in &series.points {
            let memory = point.memory.map_or_else(String::new, |bytes| bytes.to_string());
            let stages = point.stages.iter().map(|stage| (stage.name.as_str(), &stage.time));
            for (stage, time) in [(FRAME, &point.frame)].into_iter().chain(stages) {
                let _ = write!(
                    lines,
                    "{},{},{},{stage},{},{},{memory}\r\n",
                    quoted(&series.name),
                    series.of.name(),
                    point.size,
                    time.median,
                    time.p95
                );
            }
        }
    }
    lines
}

/// One page that needs nothing else.
pub fn html(results: &Results) -> String {
    let mut page = head("Scaling");
    let _ = write!(
        page,
        "<header><h1>Scaling</h1>\n<p>{}, {}, {}: how time and memory grow with what a scene has; medians of {} frames.</p></header>\n",
        escape(&results.sweep.name),
        escape(&results.environment.date),
        escape(&results.environment.device),
        results.sweep.runs
    );
    for series in &results.series {
        section(&mut page, series);
    }
    page += &measured_on(&results.environment, &results.sweep.define);
    page + "<section class=\"notes\">\n<h2>How to read it</h2>\n<p>Slope is that of log time over log size, by least squares: 1 where \
        twice as much takes twice as long, less where something takes its time whatever the size. Frames are drawn as if nothing \
        were known of the frame before. Stages of loading are timed once. Memory is the most that the process held while it loaded \
        the scene and drew it, the device's where that is the processor.</p>\n</section>\n</body>\n</html>\n"
}

fn drawn(series: &SeriesResults) -> Vec<&Growth> {
    DRAWN.iter().filter_map(|name| series.growth.iter().find(|growth| growth.stage == *name)).collect()
}

fn section(page: &mut String, series: &SeriesResults) {
    let stages = drawn(series);
    let _ = writeln!(page, "<section>\n<h2>{}</h2>", escape(&series.name));
    *page += "<div class=\"columns\">\n<figure>\n";
    let curves: Vec<Vec<[f64; 2]>> = stages
        .iter()
        .map(|growth| {
            let at = |point: &Point| Some([point.size as f64, point.milliseconds(&growth.stage)?]);
            series.points.iter().filter_map(at).collect()
        })
        .collect();
    let title = format!("time over {}, {}", series.of.name(), series.name);
    *page += &plot::curves(&curves, &title, [series.of.name(), "time (ms)"]);
    *page += "<figcaption class=\"legend\">\n";
    for (index, growth) in stages.iter().enumerate() {
        let _ = writeln!(
            page,
            "<span>{} {}: <b>slope {:.2}</b></span>",
            plot::key(index),
            escape(&growth.stage),
            growth.slope
        );
    }
    *page += "</figcaption>\n</figure>\n<table>\n<thead><tr>";
    let _ = write!(page, "<th>{}</th>", series.of.name());
    for growth in &stages {
        let _ = write!(page, "<th>{} (ms)</th>", escape(&growth.stage));
    }
    *page += "<th>memory (MiB)</th></tr></thead>\n<tbody>\n";
    for point in &series.points {
        let _ = write!(page, "<tr><th scope=\"row\">{}</th>", point.size);
        for growth in &stages {
            let _ = write!(page, "<td>{:.1}</td>", point.milliseconds(&growth.stage).unwrap_or(f64::NAN));
        }
        let memory = point
            .memory
            .map_or_else(|| "-".to_owned(), |bytes| format!("{:.0}", bytes as f64 / f64::from(1 << 20)));
        let _ = writeln!(page, "<td>{memory}</td></tr>");
    }
    *page += "</tbody>\n</table>\n</div>\n";
    if let Some(bytes) = series.bytes_each {
        let _ = writeln!(page, "<p>{bytes:.0} bytes of memory for each of the {}.</p>", series.of.name());
    }
    *page += "</section>\n";
}

#[cfg(test)]
mod tests {
    use super::super::results::tests::series;
    use super::*;

    #[test]
    fn every_stage_that_is_drawn_is_in_the_page() {
        let mut page = String::new();
        section(&mut page, &series());
        assert_eq!(page.matches("<polyline").count(), 2);
        assert!(page.contains("slope 1.00") && page.contains("slope 0.50"), "{page}");
        assert!(page.contains("100 bytes of memory for each of the tetrahedra"), "{page}");
        assert!(!page.contains("NaN"));
    }
}
