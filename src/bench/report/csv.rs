//! Results as CSV (RFC 4180): one line a point. `docs/bench.md` describes the columns.

use super::error_names;
use crate::bench::Results;
use crate::scene::March;

/// The columns before those of errors and stages.
const COLUMNS: [&str; 11] = [
    "scene",
    "width",
    "height",
    "method",
    "plan",
    "step",
    "samples",
    "runs",
    "median_ms",
    "p95_ms",
    "pareto",
];

/// All points of all scenes.
pub fn table(results: &Results) -> String {
    let points =
        || results.scenes.iter().flat_map(|scene| scene.points.iter().map(move |point| (scene, point)));
    let errors = points().next().map_or(Vec::new(), |(_, point)| error_names(point));
    let mut stages: Vec<&str> = Vec::new();
    for (_, point) in points() {
        for stage in &point.stages {
            if !stages.contains(&stage.name.as_str()) {
                stages.push(&stage.name);
            }
        }
    }

    let mut header: Vec<String> = COLUMNS.map(str::to_owned).to_vec();
    header.extend(errors.iter().cloned());
    header.extend(stages.iter().map(|stage| format!("{stage}_ms")));
    let mut lines = vec![header];
    for (scene, point) in points() {
        let (step, samples) = match point.setting.march {
            March::Default { step } => (step.to_string(), String::new()),
            March::Paper { samples } => (String::new(), samples.to_string()),
            March::Exact => (String::new(), String::new()),
        };
        let mut line = vec![
            scene.scene.display().to_string(),
            scene.width.to_string(),
            scene.height.to_string(),
            point.setting.method.clone(),
            point.setting.plan().to_owned(),
            step,
            samples,
            point.time.runs.len().to_string(),
            point.time.median.to_string(),
            point.time.p95.to_string(),
            point.pareto.to_string(),
        ];
        line.extend(errors.iter().map(|name| point.error(name).to_string()));
        line.extend(stages.iter().map(|name| {
            let stage = point.stages.iter().find(|stage| stage.name == *name);
            stage.map_or(String::new(), |stage| stage.time.median.to_string())
        }));
        lines.push(line);
    }
    let text =
        |line: Vec<String>| line.iter().map(|field| quoted(field)).collect::<Vec<_>>().join(",") + "\r\n";
    lines.into_iter().map(text).collect()
}

/// A field, in quotes where it needs them.
pub fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\r', '\n']) {
        format!("\"{}\"", field.replace('"', "\"\""))
    } else {
        field.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::results::tests::results;

    #[test]
    fn every_point_is_a_line() {
        let mut results = results();
        results.scenes[0].scene = "a, \"b\".toml".into();
        let table = table(&results);
        let lines: Vec<&str> = table.split("\r\n").collect();
        assert_eq!(
            lines[0],
            "scene,width,height,method,plan,step,samples,runs,median_ms,p95_ms,pareto,rmse,p999,max,psnr,flip,order_ms,\
             order.search_ms,march_ms"
        );
        assert_eq!(
            lines[2],
            "\"a, \"\"b\"\".toml\",2,2,shell,default,0.5,,2,20.5,21,true,0.0025,0,0,inf,0,2,1,18.5"
        );
        assert_eq!(lines[4].split(',').nth(7), Some("1"), "the samples: {}", lines[4]);
        assert_eq!((lines.len(), lines[5]), (6, ""));
    }
}
