//! Compares goals with what was measured.

use super::config::{Goal, Section};

/// Figures of a row of a table, as goals check them.
#[derive(Clone, Copy, Debug)]
pub struct GoalResult<'a> {
    /// Section.
    pub section: Section,
    /// Name of the case.
    pub case: &'a str,
    /// Number of splats that was asked for; `None` if a density was.
    pub splats: Option<usize>,
    /// Name of the transfer function.
    pub transfer: &'a str,
    /// Name of the rendering.
    pub rendering: &'a str,
    /// Mean PSNR, dB.
    pub psnr: Option<f64>,
    /// Mean SSIM.
    pub ssim: Option<f64>,
    /// CPU time per frame, ms; `None` on a GPU.
    pub core_ms: Option<f64>,
    /// Cost of the volume with its mask, divided by the cost of this row.
    pub faster: Option<f64>,
}

/// Formats the verdict of all goals for a row; empty if no goal matches it. `psnr_of` returns the PSNR of
/// another rendering of the same subject by name.
pub fn cell(goals: &[Goal], found: &GoalResult<'_>, psnr_of: impl Fn(&str) -> Option<f64>) -> String {
    let parts: Vec<String> =
        goals.iter().filter(|goal| goal.is_of(found)).map(|goal| goal.verdict(found, &psnr_of)).collect();
    parts.into_iter().filter(|part| !part.is_empty()).collect::<Vec<_>>().join("; ")
}

impl Goal {
    fn is_of(&self, found: &GoalResult<'_>) -> bool {
        let same =
            |wanted: &Option<String>, name: &str| wanted.as_deref().is_none_or(|wanted| wanted == name);
        self.section == Some(found.section)
            && same(&self.case, found.case)
            && same(&self.transfer, found.transfer)
            && same(&self.rendering, found.rendering)
            && self.splats.is_none_or(|splats| Some(splats) == found.splats)
    }

    fn verdict(&self, found: &GoalResult<'_>, psnr_of: impl Fn(&str) -> Option<f64>) -> String {
        let mut checks: Vec<(String, bool)> = Vec::new();
        let mut check =
            |text: String, wanted: Option<f64>, value: Option<f64>, holds: fn(f64, f64) -> bool| {
                if let (Some(wanted), Some(value)) = (wanted, value) {
                    checks.push((text, holds(value, wanted)));
                }
            };
        let at_least = |value: f64, wanted: f64| value >= wanted;
        let at_most = |value: f64, wanted: f64| value <= wanted;
        let text = |wanted: Option<f64>| wanted.unwrap_or_default().to_string();
        check(format!("≥ {} dB", text(self.psnr)), self.psnr, found.psnr, at_least);
        check(format!("SSIM ≥ {}", text(self.ssim)), self.ssim, found.ssim, at_least);
        if let (Some(within), Some(of)) = (self.within, &self.of) {
            let least = psnr_of(of).map(|psnr| psnr - within);
            check(format!("within {within} dB of {of}"), least, found.psnr, at_least);
        }
        check(format!("≤ {} core-ms", text(self.core_ms)), self.core_ms, found.core_ms, at_most);
        check(format!("{} times faster", text(self.faster)), self.faster, found.faster, at_least);
        let mut parts: Vec<String> = checks
            .into_iter()
            .map(|(text, holds)| format!("{text}: {}", if holds { "met" } else { "**missed**" }))
            .collect();
        // The source of a figure is told together with the figure; a figure from elsewhere stands alone.
        let asks = [self.psnr, self.ssim, self.within, self.core_ms, self.faster].iter().any(Option::is_some);
        if let Some(was) = self.was.as_ref().filter(|_| !asks || !parts.is_empty()) {
            parts.push(format!("({was})"));
        }
        parts.join(" ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found() -> GoalResult<'static> {
        GoalResult {
            section: Section::Speed,
            case: "bones",
            splats: Some(100),
            transfer: "soft",
            rendering: "slab",
            psnr: Some(30.0),
            ssim: Some(0.98),
            core_ms: Some(500.0),
            faster: Some(3.0),
        }
    }

    fn goal() -> Goal {
        Goal { section: Some(Section::Speed), ..Goal::default() }
    }

    #[test]
    fn a_goal_says_whether_it_is_met() {
        let name = |text: &str| Some(text.to_owned());
        let exact = |of: &str| (of == "exact").then_some(30.4);
        for (goal, text) in [
            (Goal { psnr: Some(30.0), was: name("prototype 31"), ..goal() }, "≥ 30 dB: met (prototype 31)"),
            (Goal { psnr: Some(30.1), ssim: Some(0.9), ..goal() }, "≥ 30.1 dB: **missed** SSIM ≥ 0.9: met"),
            (Goal { within: Some(0.5), of: name("exact"), ..goal() }, "within 0.5 dB of exact: met"),
            (Goal { within: Some(0.3), of: name("exact"), ..goal() }, "within 0.3 dB of exact: **missed**"),
            (Goal { within: Some(0.3), of: name("what is not there"), ..goal() }, ""),
            (
                Goal { core_ms: Some(464.0), was: name("web-splat"), ..goal() },
                "≤ 464 core-ms: **missed** (web-splat)",
            ),
            (Goal { faster: Some(2.5), ..goal() }, "2.5 times faster: met"),
            (Goal { was: name("prototype 15.5"), ..goal() }, "(prototype 15.5)"),
        ] {
            assert_eq!(cell(std::slice::from_ref(&goal), &found(), exact), text, "{goal:?}");
        }
        // There is no CPU time on a GPU, and then somebody else's is not told either.
        let gpu = GoalResult { core_ms: None, ..found() };
        let goal = Goal { core_ms: Some(464.0), was: name("web-splat"), ..goal() };
        assert_eq!(cell(&[goal], &gpu, exact), "");
    }

    #[test]
    fn a_goal_speaks_only_of_its_rows() {
        let name = |text: &str| Some(text.to_owned());
        let asks = |change: Goal| !cell(&[Goal { psnr: Some(1.0), ..change }], &found(), |_| None).is_empty();
        assert!(asks(goal()));
        assert!(asks(Goal { case: name("bones"), splats: Some(100), rendering: name("slab"), ..goal() }));
        assert!(!asks(Goal { section: Some(Section::Storage), ..goal() }));
        assert!(!asks(Goal { case: name("body"), ..goal() }));
        assert!(!asks(Goal { splats: Some(250), ..goal() }));
        assert!(!asks(Goal { transfer: name("steep bone"), ..goal() }));
        assert!(!asks(Goal { rendering: name("alpha"), ..goal() }));
    }
}
