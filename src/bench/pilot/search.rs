//! Which march to try next, from what those before it showed.
//!
//! Along the default plan both time and error rise with the step, the error about as its square: the step is bracketed and
//! interpolated, in logarithms. Where the step would be so small that the exact plan is the faster one, that is tried.

use super::Trial;
use crate::scene::March;

/// The step that is tried first, in texels.
const FIRST: f64 = 1.0;

/// No step above it is coarser: a scene file takes none, and a tetrahedron has its one sample long before.
const COARSEST: f64 = 1000.0;

/// The exact plan takes about the time of this step (`mesoshell bench`: nine times that of half a texel).
const AS_LONG_AS_EXACT: f64 = 0.05;

/// The finest step that is tried: below it errors are those of f32.
const FINEST: f64 = 0.01;

/// A march is coarse enough when the error accepted is used to this part: a step a tenth longer would hardly pass.
const USED: f64 = 0.8;

/// What is aimed at, as a part of the error accepted: in the middle of what is coarse enough.
const AIM: f64 = 0.9;

/// The search ends when the bracket is no wider: time is within a few percent then.
const NARROW: f64 = 1.06;

/// Steps are not guessed farther than this from what is known.
const LEAP: f64 = 16.0;

/// What comes next.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Next {
    /// This march is to be tried.
    Try(March),
    /// This trial is the choice.
    Done(Trial),
    /// None meets the error; this one came nearest.
    Impossible(Trial),
}

/// What comes after `trials`, in any order, for an error of at most `max_error`: see [`Estimate::upper`](super::Estimate::upper).
pub fn next(trials: &[Trial], max_error: f64) -> Next {
    let meets = |trial: &Trial| trial.error.upper() <= max_error;
    let mut steps: Vec<(f64, Trial)> =
        trials.iter().filter_map(|trial| Some((step(trial)?, *trial))).collect();
    steps.sort_by(|a, b| a.0.total_cmp(&b.0));
    let exact = trials.iter().find(|trial| trial.march == March::Exact);
    // The coarsest below which nothing fails: errors of single steps scatter.
    let passing = steps.iter().take_while(|(_, trial)| meets(trial)).last();
    let failing = steps.iter().find(|(_, trial)| !meets(trial));
    let aim = AIM * max_error;

    let wanted = match (passing, failing) {
        (None, None) => FIRST,
        (Some((step, trial)), None) if *step >= COARSEST || used(trial, max_error) => {
            return Next::Done(*trial);
        }
        (Some((step, trial)), None) => step * (aim / trial.error.upper()).sqrt().clamp(1.0 / USED, LEAP),
        (Some((step, trial)), Some((too_long, _))) if used(trial, max_error) || too_long / step <= NARROW => {
            return Next::Done(*trial);
        }
        (Some((step, trial)), Some((too_long, failed))) => {
            let part = (aim / trial.error.upper()).ln() / (failed.error.upper() / trial.error.upper()).ln();
            // A trial without any error tells no slope.
            let part = if part.is_finite() { part.clamp(0.1, 0.9) } else { 0.5 };
            step * (too_long / step).powf(part)
        }
        (None, Some((too_long, failed))) => {
            let wanted = too_long * (aim / failed.error.upper()).sqrt().clamp(1.0 / LEAP, USED);
            match exact {
                Some(exact) if meets(exact) && wanted < AS_LONG_AS_EXACT => return Next::Done(*exact),
                None if wanted < AS_LONG_AS_EXACT => return Next::Try(March::Exact),
                Some(exact) if *too_long <= FINEST => {
                    let nearest = |a: &&Trial, b: &&Trial| a.error.upper().total_cmp(&b.error.upper());
                    return Next::Impossible(*trials.iter().min_by(nearest).unwrap_or(exact));
                }
                _ => wanted,
            }
        }
    };
    Next::Try(March::Default { step: legible(wanted.clamp(FINEST, COARSEST)) })
}

fn used(trial: &Trial, max_error: f64) -> bool {
    trial.error.upper() >= USED * max_error
}

fn step(trial: &Trial) -> Option<f64> {
    match trial.march {
        March::Default { step } => Some(step),
        March::Paper { .. } | March::Exact => None,
    }
}

/// Three significant digits: a step that can be copied into a scene file.
fn legible(step: f64) -> f64 {
    format!("{step:.2e}").parse().expect("written as a number")
}

#[cfg(test)]
mod tests {
    use super::super::Estimate;
    use super::*;

    /// Searches on a scene whose error is known for every march.
    fn search(max_error: f64, error: impl Fn(March) -> f64) -> (Next, Vec<Trial>) {
        let mut trials = Vec::new();
        loop {
            match next(&trials, max_error) {
                Next::Try(march) => {
                    assert!(
                        trials.iter().all(|trial: &Trial| trial.march != march),
                        "{march:?} again: {trials:?}"
                    );
                    let rmse = error(march);
                    trials.push(Trial { march, error: Estimate { rmse, standard_error: 0.05 * rmse } });
                }
                end => return (end, trials),
            }
            assert!(trials.len() <= 12, "{trials:?}");
        }
    }

    /// Quadratic in the step until there is one sample a tetrahedron; the exact plan errs by f32 rounding.
    fn smooth(march: March) -> f64 {
        match march {
            March::Default { step } => 3e-4 * step.min(8.0).powi(2) + 1e-7,
            _ => 4e-7,
        }
    }

    #[test]
    fn the_coarsest_step_is_found_in_few_trials() {
        for max_error in [1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5] {
            let (end, trials) = search(max_error, smooth);
            let Next::Done(trial) = end else { panic!("{end:?}") };
            let upper = trial.error.upper();
            assert!(upper <= max_error && upper >= USED * max_error, "{max_error}: {trial:?}");
            assert!(trials.len() <= 4, "{max_error}: {trials:?}");
        }
    }

    #[test]
    fn a_kink_is_found_by_bracketing() {
        let kinked = |march| match march {
            March::Default { step } if step > 2.345 => 0.1,
            other => smooth(other),
        };
        let (end, _) = search(1e-2, kinked);
        let Next::Done(Trial { march: March::Default { step }, .. }) = end else { panic!("{end:?}") };
        assert!(step <= 2.345 && step * NARROW >= 2.345, "{step}");
    }

    #[test]
    fn one_sample_a_tetrahedron_is_the_cheapest() {
        let (end, _) = search(0.5, smooth);
        assert!(matches!(end, Next::Done(Trial { march: March::Default { step: COARSEST }, .. })), "{end:?}");
        // A picture of nothing has no error at all.
        let (end, _) = search(0.5, |_| 0.0);
        assert!(matches!(end, Next::Done(Trial { march: March::Default { step: COARSEST }, .. })), "{end:?}");
    }

    #[test]
    fn the_exact_plan_serves_the_smallest_errors() {
        let (end, trials) = search(6e-7, smooth);
        assert!(matches!(end, Next::Done(Trial { march: March::Exact, .. })), "{end:?}");
        assert!(trials.len() <= 3, "{trials:?}");
        // Where cycles keep it from being exact, finer steps may still do.
        let cycles = |march| if march == March::Exact { 3e-5 } else { smooth(march) };
        let (end, _) = search(5e-7, cycles);
        assert!(matches!(end, Next::Done(Trial { march: March::Default { .. }, .. })), "{end:?}");
    }

    #[test]
    fn what_cannot_be_is_said() {
        let (end, _) = search(1e-9, smooth);
        let Next::Impossible(best) = end else { panic!("{end:?}") };
        assert!(best.error.rmse < 5e-7, "{best:?}");
        let (end, _) = search(1e-3, |_| f64::INFINITY);
        assert!(matches!(end, Next::Impossible(_)), "{end:?}");
    }

    #[test]
    fn what_is_known_does_not_make_the_choice_dearer() {
        let (_, mut trials) = search(1e-4, smooth);
        trials.extend(search(6e-7, smooth).1);
        let mut next_step = next(&trials, 3e-5);
        while let Next::Try(march) = next_step {
            let rmse = smooth(march);
            trials.push(Trial { march, error: Estimate { rmse, standard_error: 0.05 * rmse } });
            next_step = next(&trials, 3e-5);
        }
        assert!(matches!(next_step, Next::Done(Trial { march: March::Default { .. }, .. })), "{next_step:?}");
    }

    #[test]
    fn known_trials_serve_another_error() {
        let (_, trials) = search(1e-3, smooth);
        let Next::Try(March::Default { step }) = next(&trials, 6e-4) else { panic!("{trials:?}") };
        assert!((smooth(March::Default { step }) / 6e-4 - 0.8).abs() < 0.15, "{step}");
        assert!(matches!(next(&trials, 1e-3), Next::Done(_)));
    }
}
