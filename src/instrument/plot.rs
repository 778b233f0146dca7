//! Curves over the frames, as SVG; colours and type come from the page's style sheet.

use std::fmt::Write;

use crate::bench::report::html::escape;

const WIDTH: f64 = 600.0;
const HEIGHT: f64 = 200.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 588.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 160.0;

/// A number over the frames; where there is none the curve is broken.
pub struct Curve {
    /// As the legend calls it.
    pub name: &'static str,
    /// One a frame.
    pub values: Vec<Option<f64>>,
}

/// The plot of some curves, one value a frame each, with a legend.
pub fn svg(title: &str, frames: &[u32], curves: &[Curve]) -> String {
    let (first, last) = (f64::from(frames[0]), f64::from(frames[frames.len() - 1]));
    let drawn = || curves.iter().flat_map(|curve| &curve.values).flatten().copied().filter(|v| v.is_finite());
    let (low, high) = drawn().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    // Where there is nothing there is an axis from 0 to 1; flat curves get some room, and counts start at 0.
    let (low, high) = if low <= high && (low, high) != (0.0, 0.0) { (low, high) } else { (0.0, 1.0) };
    let room = (0.05 * (high - low)).max(1e-3 * high.abs());
    let (low, high) = (if low == 0.0 { 0.0 } else { low - room }, high + room);
    let x = |frame: u32| {
        LEFT + (RIGHT - LEFT) * if first < last { (f64::from(frame) - first) / (last - first) } else { 0.5 }
    };
    let y = |value: f64| BOTTOM + (TOP - BOTTOM) * (value - low) / (high - low);

    let mut svg = format!(
        "<figure><svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">\n",
        escape(title)
    );
    let digits = |step: f64| (-step.log10().floor()).clamp(0.0, 9.0) as usize;
    let step = step((high - low) / 4.0);
    for tick in
        (0..).map(|i| ((low / step).ceil() + f64::from(i)) * step).take_while(|&tick| tick <= high).take(16)
    {
        let at = y(tick);
        let _ = writeln!(
            svg,
            "<path class=\"grid\" d=\"M{LEFT} {at:.1}H{RIGHT}\"/><text class=\"tick\" x=\"{}\" y=\"{:.1}\" \
             text-anchor=\"end\">{tick:.*}</text>",
            LEFT - 8.0,
            at + 4.0,
            digits(step)
        );
    }
    for &frame in frames.iter().step_by(frames.len().div_ceil(8)) {
        let _ = writeln!(
            svg,
            "<text class=\"tick\" x=\"{:.1}\" y=\"{}\" text-anchor=\"middle\">{frame}</text>",
            x(frame),
            BOTTOM + 18.0
        );
    }
    let _ = writeln!(
        svg,
        "<path class=\"axis\" d=\"M{LEFT} {TOP}V{BOTTOM}H{RIGHT}\"/>\
         <text class=\"note\" x=\"{RIGHT}\" y=\"{}\" text-anchor=\"end\">frame</text>",
        HEIGHT - 6.0
    );
    for (index, curve) in curves.iter().enumerate() {
        let _ = write!(svg, "<g class=\"curve c{}\">", index % 4);
        let values: Vec<(u32, Option<f64>)> = frames
            .iter()
            .copied()
            .zip(curve.values.iter().map(|value| value.filter(|v| v.is_finite())))
            .collect();
        for run in values.split(|(_, value)| value.is_none()).filter(|run| !run.is_empty()) {
            let points = run.iter().filter_map(|&(frame, value)| Some((x(frame), y(value?))));
            let points: Vec<String> = points.map(|(x, y)| format!("{x:.1},{y:.1}")).collect();
            match points.as_slice() {
                [one] => {
                    let (x, y) = one.split_once(',').expect("as it was just written");
                    let _ = write!(svg, "<circle cx=\"{x}\" cy=\"{y}\" r=\"3\" fill=\"currentColor\"/>");
                }
                _ => {
                    let _ = write!(svg, "<polyline points=\"{}\"/>", points.join(" "));
                }
            }
        }
        svg += "</g>\n";
    }
    svg += "</svg>\n<figcaption class=\"legend\">";
    let _ = write!(svg, "<b>{}</b>", escape(title));
    for (index, curve) in curves.iter().enumerate() {
        let _ = write!(
            svg,
            "<span><svg class=\"wide key\" viewBox=\"-16 -8 32 16\"><g class=\"curve c{}\">\
             <polyline points=\"-16,0 16,0\"/></g></svg> {}</span>",
            index % 4,
            escape(curve.name)
        );
    }
    svg + "</figcaption></figure>\n"
}

/// 1, 2 or 5 times a power of ten, no less than a number.
fn step(least: f64) -> f64 {
    if !(least > 0.0 && least.is_finite()) {
        return 1.0;
    }
    let power = 10.0_f64.powf(least.log10().floor());
    [1.0, 2.0, 5.0]
        .map(|multiple| multiple * power)
        .into_iter()
        .find(|&step| step >= least)
        .unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_round() {
        assert_eq!([0.9, 1.0, 1.1, 30.0, 700.0, 0.0].map(step), [1.0, 1.0, 2.0, 50.0, 1000.0, 1.0]);
    }

    #[test]
    fn curves_are_broken_where_there_is_nothing_and_never_leave_the_plot() {
        let values = vec![None, Some(1.0), Some(2.0), None, Some(3.0), Some(f64::INFINITY)];
        let drawn = svg("a & b", &[1, 2, 3, 4, 5, 6], &[Curve { name: "one", values }]);
        assert_eq!(drawn.matches("<polyline").count(), 2, "a line, and the legend's");
        assert_eq!(drawn.matches("<circle").count(), 1);
        assert!(drawn.contains("a &amp; b") && !drawn.contains("NaN") && !drawn.contains("inf"));
        let flat = svg("none", &[4], &[Curve { name: "one", values: vec![Some(0.0)] }]);
        assert!(!flat.contains("NaN") && !flat.contains("inf"));
    }
}
