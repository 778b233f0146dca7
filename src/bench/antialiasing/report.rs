//! The results for spreadsheets and for people.

use std::fmt::Write;

use super::results::{Picture, Results, SceneResults};
use super::run::Pictures;
use crate::bench::report::csv::quoted;
use crate::bench::report::html::{escape, head, measured_on};
use crate::bench::report::picture::data_uri;

/// CSV (RFC 4180): one line a scene, distance and filter.
pub fn csv(results: &Results) -> String {
    let mut lines = "scene,distance,width,height,level,filter,rmse,p999,max,psnr,flip,bias\r\n".to_owned();
    for scene in &results.scenes {
        for picture in &scene.pictures {
            let Picture { distance, width, height, level, .. } = picture;
            for point in &picture.points {
                let error = &point.error;
                let _ = write!(
                    lines,
                    "{},{distance},{width},{height},{level},{},{},{},{},{},{},{}\r\n",
                    quoted(&scene.scene.display().to_string()),
                    point.filter.name(),
                    error.rmse,
                    error.p999,
                    error.max,
                    error.psnr,
                    error.flip,
                    point.bias
                );
            }
        }
    }
    lines
}

/// One page that needs nothing else.
pub fn html(results: &Results, pictures: &[Pictures]) -> String {
    let mut page = head("Antialiasing");
    let _ = write!(
        page,
        "<header><h1>Antialiasing</h1>\n<p>{}, {}, {}: the mipmapped level of detail against {} rays a pixel through the full \
         volume, in linear premultiplied RGBA, where white is 1.</p></header>\n",
        escape(&results.sweep.name),
        escape(&results.environment.date),
        escape(&results.environment.device),
        results.sweep.rays
    );
    means(&mut page, results);
    for (scene, pictures) in results.scenes.iter().zip(pictures) {
        section(&mut page, results, scene, pictures);
    }
    page += &measured_on(&results.environment, &results.sweep.define);
    page + "<section class=\"notes\">\n<h2>How to read it</h2>\n<p>From distance k the eye is k times as far from its target. \
        Level is the median level of detail. Bias is the sum of alpha over the picture as a part of the reference's, less 1: \
        positive where a filter hides too much.</p>\n</section>\n</body>\n</html>\n"
}

fn means(page: &mut String, results: &Results) {
    *page +=
        "<section>\n<h2>RMSE, the geometric mean over the scenes</h2>\n<table>\n<thead><tr><th>filter</th>";
    for distance in &results.sweep.distances {
        let _ = write!(page, "<th>from {distance}</th>");
    }
    *page += "<th>all</th></tr></thead>\n<tbody>\n";
    for mean in &results.means {
        let _ = write!(page, "<tr><th scope=\"row\">{}</th>", mean.filter.name());
        for rmse in mean.by_distance.iter().chain([&mean.rmse]) {
            let _ = write!(page, "<td>{rmse:.1e}</td>");
        }
        *page += "</tr>\n";
    }
    *page += "</tbody>\n</table>\n</section>\n";
}

fn section(page: &mut String, results: &Results, scene: &SceneResults, pictures: &Pictures) {
    let _ = writeln!(page, "<section>\n<h2>{}</h2>", escape(&scene.name()));
    *page += "<table>\n<thead><tr><th>distance</th><th>level</th><th>filter</th><th>RMSE</th><th>99.9 %</th><th>FLIP</th>\
              <th>bias</th></tr></thead>\n<tbody>\n";
    for picture in &scene.pictures {
        for point in &picture.points {
            let _ = writeln!(
                page,
                "<tr><th scope=\"row\">{}</th><td>{:.1}</td><td>{}</td><td>{:.1e}</td><td>{:.1e}</td><td>{:.1e}</td>\
                 <td>{:+.1} %</td></tr>",
                picture.distance,
                picture.level,
                point.filter.name(),
                point.error.rmse,
                point.error.p999,
                point.error.flip,
                100.0 * point.bias
            );
        }
    }
    *page += "</tbody>\n</table>\n";
    for (index, picture) in scene.pictures.iter().enumerate() {
        let names = results.sweep.filters.iter().map(|filter| filter.name());
        let images = pictures.filtered.iter().map(|images| &images[index]);
        *page += "<div class=\"gallery\">\n";
        for (name, image) in
            std::iter::once(("reference", &pictures.references[index])).chain(names.zip(images))
        {
            let caption = format!("{name}, from {}", picture.distance);
            let _ = writeln!(
                page,
                "<figure><img class=\"pixels\" src=\"{}\" width=\"{}\" height=\"{}\" \
                 alt=\"{caption}\"><figcaption>{caption}</figcaption></figure>",
                data_uri(image, &pictures.backdrop),
                image.width,
                image.height
            );
        }
        *page += "</div>\n";
    }
    *page += "</section>\n";
}
