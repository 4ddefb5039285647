//! Whether the clocks of the agents are known well enough for robots that are tied together.

use std::time::Duration;

use armada_protocol::messages::{Coupling, Denial, DenialCode};

use super::{Context, Group};
use crate::coordinator::plan;

impl Group {
    /// Why the motion must not start, or go on: a clock that is not known well enough.
    ///
    /// With `fresh`, agents are left out whose last round trip is older: nothing is known of how
    /// well their clocks could be measured, and their partners watch them.
    pub(super) fn clock_refusal(
        &self,
        fresh: Option<Duration>,
        cx: &Context<'_>,
    ) -> Option<Denial> {
        if self.coupling == Coupling::Independent || !self.has_partners() {
            return None;
        }
        let budget = cx.timers.clock_budget;
        self.parts.keys().find_map(|robot| {
            let clock = &cx.robots.get(robot)?.clock;
            let age = cx.now.saturating_since(clock.measured()?);
            if fresh.is_some_and(|fresh| age > fresh) {
                return None;
            }
            let bound = Duration::from_nanos(clock.best(cx.now)?.bound_ns);
            (bound > budget).then(|| {
                let [bound_ms, budget_ms] = [bound, budget].map(|time| 1e3 * time.as_secs_f64());
                let message = format!(
                    "its clock is known to {bound_ms:.3} ms only, robots that are tied together \
                     need {budget_ms} ms (motion.clock_budget_ms)"
                );
                plan::of(robot, DenialCode::NotReady, &message)
                    .with("bound_ms", bound_ms)
                    .with("budget_ms", budget_ms)
            })
        })
    }
}
