//! How much faster than the paper's plan a scene is drawn with no more error.

use super::results::{Point, Results, SceneResults};
use super::sweep::Setting;
use crate::scene::March;

/// The fastest point of other plans that errs no more than one of the paper's.
#[derive(Debug, Clone, PartialEq)]
pub struct Speedup {
    /// Of the paper's plan: [`March::Paper`].
    pub samples: u32,
    /// What was compared; `None` where all others err more.
    pub setting: Option<Setting>,
    /// The paper's median time over that of the other.
    pub ratio: Option<f64>,
}

impl SceneResults {
    /// One for each point of the paper's plan; by RMSE.
    pub fn speedups(&self) -> Vec<Speedup> {
        let others = |paper: &Point| {
            let as_exact = |point: &&Point| point.setting.plan() != "paper" && point.rmse() <= paper.rmse();
            self.points
                .iter()
                .filter(as_exact)
                .min_by(|a, b| a.time.median.total_cmp(&b.time.median))
                .cloned()
        };
        let speedup = |paper: &Point| {
            let March::Paper { samples } = paper.setting.march else { return None };
            let other = others(paper);
            Some(Speedup {
                samples,
                ratio: other.as_ref().map(|other| paper.time.median / other.time.median),
                setting: other.map(|other| other.setting),
            })
        };
        self.points.iter().filter_map(speedup).collect()
    }
}

impl Results {
    /// The geometric mean over the scenes of the speed-up over so many samples of the paper's plan, or as many as each scene says; `None`
    /// unless every scene has one.
    pub fn mean_speedup(&self, samples: Option<u32>) -> Option<f64> {
        let ratio = |scene: &SceneResults| {
            let samples = samples.or(scene.own_samples)?;
            scene.speedups().into_iter().find(|one| one.samples == samples)?.ratio
        };
        let ratios: Option<Vec<f64>> = self.scenes.iter().map(ratio).collect();
        let ratios = ratios.filter(|ratios| !ratios.is_empty())?;
        Some((ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp())
    }

    /// Speed-ups that are less than those of `baseline` by more than the part `loss`, each told; and those that `baseline` has and these
    /// results lack. Scenes are the same where their paths are.
    pub fn slower_than(&self, baseline: &Self, loss: f64) -> Vec<String> {
        let mut slower = Vec::new();
        for scene in &baseline.scenes {
            let now = self.scenes.iter().find(|now| now.scene == scene.scene);
            let now = now.map(SceneResults::speedups).unwrap_or_default();
            for Speedup { samples, ratio, .. } in scene.speedups() {
                let Some(before) = ratio else { continue };
                let now = now.iter().find(|now| now.samples == samples).and_then(|now| now.ratio);
                if now.is_none_or(|now| now < (1.0 - loss) * before) {
                    let now = now.map_or_else(|| "none is as accurate".to_owned(), |now| format!("{now:.2}"));
                    slower.push(format!("{}, {samples} samples: {now}, was {before:.2}", scene.name()));
                }
            }
        }
        slower
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::results::tests::results;

    #[test]
    fn the_fastest_that_errs_no_more_counts() {
        // One sample of the paper's plan takes 30.5 ms and errs by 0.1, a step of 1 takes 10.5 ms and errs by 0.01.
        let mut found = results();
        let one = &found.scenes[0].speedups()[0];
        assert_eq!((one.samples, one.setting.as_ref().unwrap().march), (1, March::Default { step: 1.0 }));
        assert!((one.ratio.unwrap() - 30.5 / 10.5).abs() < 1e-12);
        assert!((found.mean_speedup(Some(1)).unwrap() - 30.5 / 10.5).abs() < 1e-12);
        assert_eq!((found.mean_speedup(Some(2)), found.mean_speedup(None)), (None, None));
        found.scenes[0].own_samples = Some(1);
        assert_eq!(found.mean_speedup(None), found.mean_speedup(Some(1)));
        let paper = found.scenes[0].points.last_mut().unwrap();
        paper.error.insert("rmse".to_owned(), Some(1e-6));
        assert_eq!(found.scenes[0].speedups()[0].ratio, None);
        assert_eq!(found.mean_speedup(Some(1)), None);
    }

    #[test]
    fn what_has_become_slower_is_told() {
        let before = results();
        assert!(before.slower_than(&before, 0.15).is_empty());
        let mut slow = results();
        for point in &mut slow.scenes[0].points[..3] {
            point.time.median *= 1.3;
        }
        let told = slow.slower_than(&before, 0.15);
        assert!(told.len() == 1 && told[0].contains("1 samples: 2.23, was 2.90"), "{told:?}");
        assert!(slow.slower_than(&before, 0.25).is_empty());
        slow.scenes.clear();
        assert_eq!(slow.slower_than(&before, 0.15), ["fog & fur, 1 samples: none is as accurate, was 2.90"]);
    }
}
