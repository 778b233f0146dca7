//! Plots, such as that of error over time, with logarithmic axes, as SVG. Colours and type come from the page's style sheet.

use std::fmt::Write;
use std::ops::Range;

use super::html::escape;
use crate::bench::convergence::ROUNDING_FLOOR;
use crate::bench::results::{Curve, Point, SceneResults};

/// The drawing, in its own units.
const WIDTH: f64 = 600.0;
const HEIGHT: f64 = 380.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 588.0;
const TOP: f64 = 14.0;
const BOTTOM: f64 = 334.0;

/// The least error that is drawn; what is below stands there.
const LEAST_ERROR: f64 = 1e-9;

/// A logarithmic axis.
struct Axis {
    /// Values at the ends.
    values: Range<f64>,
    /// Where the ends lie.
    ends: Range<f64>,
}

impl Axis {
    /// An axis that shows all `values`, with some room around them.
    fn around(values: impl Iterator<Item = f64>, room: f64, ends: Range<f64>) -> Self {
        let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), v| (low.min(v), high.max(v)));
        let (low, high) = if low <= high { (low, high) } else { (1.0, 1.0) };
        Self { values: low / room..high * room, ends }
    }

    fn place(&self, value: f64) -> f64 {
        let part = (value / self.values.start).ln() / (self.values.end / self.values.start).ln();
        self.ends.start + part * (self.ends.end - self.ends.start)
    }

    /// Powers of ten; where these are few, multiples of them too.
    fn ticks(&self) -> Vec<f64> {
        let exponents = self.values.start.log10().floor() as i32..=self.values.end.log10().ceil() as i32;
        let ticks = |multiples: &[f64]| -> Vec<f64> {
            let decades = exponents.clone().map(|exponent| 10_f64.powi(exponent));
            let ticks = decades.flat_map(|decade| multiples.iter().map(move |multiple| multiple * decade));
            ticks.filter(|tick| self.values.contains(tick)).collect()
        };
        let fine = ticks(&[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0]);
        [ticks(&[1.0]), ticks(&[1.0, 2.0, 5.0])].into_iter().find(|ticks| ticks.len() >= 3).unwrap_or(fine)
    }
}

/// The plot of a scene.
pub fn svg(scene: &SceneResults) -> String {
    let error = |point: &Point| point.rmse().max(LEAST_ERROR);
    let drawn = |point: &&Point| point.rmse().is_finite() && point.time.median > 0.0;
    let points = || scene.points.iter().filter(drawn);
    let x = Axis::around(points().map(|point| point.time.median), 1.25, LEFT..RIGHT);
    let y = Axis::around(points().map(error), 1.8, BOTTOM..TOP);
    let place = |point: &Point| [x.place(point.time.median), y.place(error(point))];

    let mut svg = format!(
        "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"error over time of {}\">\n",
        escape(&scene.name())
    );
    grid(&mut svg, &x, &y, ["time per frame (ms), median", "RMSE"], |tick| format!("{tick:e}"));
    floor(&mut svg, &y);
    let mut front: Vec<[f64; 2]> = points().filter(|point| point.pareto).map(&place).collect();
    front.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let _ = writeln!(svg, "<path class=\"front\" d=\"{}\"/>", staircase(&front));
    for (index, curve) in scene.curves.iter().enumerate() {
        let points: Vec<&Point> = scene.points_of(curve).filter(drawn).collect();
        let line: Vec<String> =
            points.iter().map(|point| place(point).map(|c| format!("{c:.1}")).join(",")).collect();
        let _ = writeln!(svg, "<g class=\"{}\">\n<polyline points=\"{}\"/>", class(index), line.join(" "));
        for point in points {
            mark(&mut svg, index, curve, point, place(point));
        }
        svg += "</g>\n";
    }
    svg + "</svg>\n"
}

/// The class by which the style sheet colours a curve.
pub fn class(index: usize) -> String {
    format!("curve c{}", index % 4)
}

/// The sign of a curve around the origin: another shape for each, so that colour is not all that tells them apart.
pub fn shape(index: usize) -> &'static str {
    match index % 4 {
        0 => "<circle r=\"5\"/>",
        1 => "<path d=\"M-4.5-4.5h9v9h-9z\"/>",
        2 => "<path d=\"M0-6 5.6 4.4H-5.6z\"/>",
        _ => "<path d=\"M0-6 6 0 0 6-6 0z\"/>",
    }
}

/// Curves through points `[x, y]`, each positive; a title for who cannot see it, and what the axes are.
pub fn curves(curves: &[Vec<[f64; 2]>], title: &str, axes: [&str; 2]) -> String {
    let values =
        |axis: usize| curves.iter().flatten().map(move |point| point[axis]).filter(|value| *value > 0.0);
    let x = Axis::around(values(0), 1.25, LEFT..RIGHT);
    let y = Axis::around(values(1), 1.5, BOTTOM..TOP);
    let mut svg = format!(
        "<svg class=\"plot\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" aria-label=\"{}\">\n",
        escape(title)
    );
    grid(&mut svg, &x, &y, axes, |tick| tick.to_string());
    for (index, points) in curves.iter().enumerate() {
        let places: Vec<[f64; 2]> = points
            .iter()
            .filter(|point| point.iter().all(|value| *value > 0.0))
            .map(|point| [x.place(point[0]), y.place(point[1])])
            .collect();
        let line: Vec<String> = places.iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        let _ = writeln!(svg, "<g class=\"{}\">\n<polyline points=\"{}\"/>", class(index), line.join(" "));
        for [x, y] in places {
            let _ = writeln!(
                svg,
                "<g class=\"mark full\" transform=\"translate({x:.1} {y:.1})\">{}</g>",
                shape(index)
            );
        }
        svg += "</g>\n";
    }
    svg + "</svg>\n"
}

/// The sign of a curve, for a legend.
pub fn key(index: usize) -> String {
    format!(
        "<svg class=\"key\" viewBox=\"-8 -8 16 16\"><g class=\"{}\"><g class=\"mark full\">{}</g></g></svg>",
        class(index),
        shape(index)
    )
}

/// Lines at round values, and the two axes with what they are; `y_label` writes those of the upright one.
fn grid(svg: &mut String, x: &Axis, y: &Axis, [across, up]: [&str; 2], y_label: impl Fn(f64) -> String) {
    for tick in x.ticks() {
        let at = x.place(tick);
        let _ = writeln!(
            svg,
            "<path class=\"grid\" d=\"M{at:.1} {TOP}V{BOTTOM}\"/>\
             <text class=\"tick\" x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{tick}</text>",
            BOTTOM + 18.0
        );
    }
    for tick in y.ticks() {
        let at = y.place(tick);
        let _ = writeln!(
            svg,
            "<path class=\"grid\" d=\"M{LEFT} {at:.1}H{RIGHT}\"/>\
             <text class=\"tick\" x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            LEFT - 8.0,
            at + 4.0,
            y_label(tick)
        );
    }
    let _ = writeln!(
        svg,
        "<path class=\"axis\" d=\"M{LEFT} {TOP}V{BOTTOM}H{RIGHT}\"/>\
         <text class=\"note\" x=\"{RIGHT}\" y=\"{}\" text-anchor=\"end\">{across}</text>\
         <text class=\"note\" transform=\"translate(14 {TOP}) rotate(-90)\" text-anchor=\"end\">{up}</text>",
        HEIGHT - 10.0
    );
}

/// Where errors are those of rounding.
fn floor(svg: &mut String, y: &Axis) {
    if y.values.contains(&ROUNDING_FLOOR) {
        let at = y.place(ROUNDING_FLOOR);
        let _ = writeln!(
            svg,
            "<path class=\"floor\" d=\"M{LEFT} {at:.1}H{RIGHT}\"/>\
             <text class=\"note\" x=\"{}\" y=\"{:.1}\">below: rounding</text>",
            LEFT + 6.0,
            at + 14.0
        );
    }
}

/// The border of what no point reaches: from each point of the front level to the time of the next, then down.
fn staircase(front: &[[f64; 2]]) -> String {
    let Some(([x, y], rest)) = front.split_first() else { return String::new() };
    let mut path = format!("M{x:.1} {TOP}V{y:.1}");
    for [x, y] in rest {
        let _ = write!(path, "H{x:.1}V{y:.1}");
    }
    let _ = write!(path, "H{RIGHT}");
    path
}

/// A point, full where it is on the front, and its level beside it.
fn mark(svg: &mut String, index: usize, curve: &Curve, point: &Point, [x, y]: [f64; 2]) {
    let fill = if point.pareto { "full" } else { "hollow" };
    let level = point.setting.level();
    let number = level.split(' ').find(|word| word.parse::<f64>().is_ok()).unwrap_or(&level);
    // Neighbouring curves have their labels on opposite sides.
    let (dx, dy, anchor) = if index.is_multiple_of(2) { (-9, 15, "end") } else { (9, -8, "start") };
    let _ = writeln!(
        svg,
        "<g class=\"mark {fill}\" transform=\"translate({x:.1} {y:.1})\"><title>{}, {level}: {:.1} ms, RMSE {:.1e}</title>\
         {}<text x=\"{dx}\" y=\"{dy}\" text-anchor=\"{anchor}\">{number}</text></g>",
        escape(&curve.method),
        point.time.median,
        point.rmse(),
        shape(index)
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::results::tests::results;

    #[test]
    fn an_axis_is_logarithmic() {
        let axis = Axis { values: 1.0..1e4, ends: 100.0..500.0 };
        assert!((axis.place(1e3) - 400.0).abs() < 1e-9);
        assert_eq!(axis.ticks(), [1.0, 10.0, 100.0, 1000.0]);
        let short = Axis { values: 15.0..60.0, ends: 0.0..1.0 };
        assert_eq!(short.ticks(), [15.0, 20.0, 30.0, 40.0, 50.0]);
    }

    #[test]
    fn the_front_is_a_staircase() {
        assert_eq!(staircase(&[[100.0, 50.0], [200.0, 90.0]]), "M100.0 14V50.0H200.0V90.0H588");
        assert_eq!(staircase(&[]), "");
    }

    #[test]
    fn every_point_is_drawn() {
        let mut results = results();
        let drawn = |scene: &SceneResults| svg(scene).matches("<g class=\"mark").count();
        assert_eq!(drawn(&results.scenes[0]), 4);
        assert_eq!(svg(&results.scenes[0]).matches("mark hollow").count(), 1);
        // An exact picture has a place, one that is not finite has none.
        results.scenes[0].points[0].error.insert("rmse".to_owned(), Some(0.0));
        results.scenes[0].points[1].error.insert("rmse".to_owned(), None);
        assert_eq!(drawn(&results.scenes[0]), 3);
        assert!(!svg(&results.scenes[0]).contains("NaN") && !svg(&results.scenes[0]).contains("inf"));
        results.scenes[0].points.truncate(0);
        assert!(!svg(&results.scenes[0]).contains("NaN"));
    }
}
