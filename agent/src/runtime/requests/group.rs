//! What is looked at before a trajectory is followed together with other robots.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::Duration;

use armada_model::CompiledTrajectory;
use armada_protocol::messages::{Coupling, Denial, DenialCode, GroupParams, GroupReadiness};
use serde_json::Value;

use super::Requests;
use crate::control::{
    BEAT, GENTLE_SLOPE_S, GroupOrder, MAX_PARTNERS, Readiness, StartTravel, stretch_for_slope,
};

/// Silence of a partner that may be asked for \[ms\].
const LOSS_MS: (f64, f64) = (30.0, 150.0);
/// Difference of phases that may be asked for \[ms\].
const DIVERGENCE_MS: (f64, f64) = (1.0, 1000.0);
/// Slowest change of the rate with which a rigid group can end together \[1/s\].
const RIGID_SLOPE_S: f64 = 0.5;
/// Furthest that a joint of a rigid group may get before it rests, if a partner is lost at the start
/// \[rad or m\].
const RIGID_TRAVEL: f64 = 2e-3;

/// How a prepared trajectory is to be followed with others.
#[derive(Clone, Copy, Debug)]
pub(super) struct PreparedGroup {
    /// All but the change of the rate, which the commit names.
    order: GroupOrder,
    /// The fastest change of the rate that this robot can follow \[1/s\].
    rate_slope_s: f64,
}

impl PreparedGroup {
    /// Whether all robots go at one rate, whatever each would go at alone.
    pub(super) fn shares_pace(&self) -> bool {
        self.order.coupling != Coupling::Independent
    }

    /// The order for the loop, with the change of the rate \[1/s\] that all robots can follow.
    pub(super) fn order(&self, rate_slope_s: Option<f64>) -> Result<GroupOrder, Denial> {
        let asked = rate_slope_s.unwrap_or_default();
        let limit = self.rate_slope_s;
        let refuse = |message: String| {
            Err(Denial::new(DenialCode::OutOfRange, message)
                .with("field", "rate_slope_s")
                .with("value", asked)
                .with("limit", limit))
        };
        if !(0.0..=limit).contains(&asked) {
            return refuse(format!("rate_slope_s is {asked}, this robot can follow 0 to {limit}"));
        }
        if self.order.coupling == Coupling::Rigid && asked < RIGID_SLOPE_S {
            return refuse(format!(
                "rate_slope_s is {asked}, a rigid group needs {RIGID_SLOPE_S} to {limit}"
            ));
        }
        let rate_slope_s = if asked > 0.0 { asked } else { GENTLE_SLOPE_S };
        Ok(GroupOrder { rate_slope_s, ..self.order })
    }
}

impl Requests {
    /// Looks whether this robot can follow `trajectory` with others, and says what they need to
    /// know of it.
    pub(super) async fn prepare_group(
        &self,
        (params, model_rev): (&GroupParams, u64),
        trajectory: &Arc<CompiledTrajectory>,
    ) -> Result<(PreparedGroup, GroupReadiness), Denial> {
        self.check_partners(params)?;
        self.check_times(params)?;
        let loss = Duration::from_millis(params.loss_ms);
        let window_s = (loss + self.params.period).as_secs_f64();
        let start = StartTravel::of(trajectory, window_s);
        let readiness = self.look_at(trajectory).await?;
        if params.coupling == Coupling::Rigid {
            self.check_rigid(trajectory, &readiness, (start, window_s))?;
        }
        let Readiness { stop_time_s, rate_slope_s } = readiness;
        let order = GroupOrder {
            coupling: params.coupling,
            // At most 15.
            partners: u8::try_from(params.partners.len()).unwrap_or_default(),
            loss,
            max_divergence_s: params.max_divergence_ms * 1e-3,
            rate_slope_s: 0.0,
        };
        let answer = GroupReadiness {
            stop_time_s,
            rate_slope_s,
            start_travel: start.travel,
            controller_lag_ms: self.params.tracking_lag.as_secs_f64() * 1e3,
            model_rev,
        };
        Ok((PreparedGroup { order, rate_slope_s }, answer))
    }

    /// What takes too long for a task: own links, stops and changes of the rate.
    async fn look_at(&self, trajectory: &Arc<CompiledTrajectory>) -> Result<Readiness, Denial> {
        let failed = |_| Denial::new(DenialCode::Internal, "the trajectory could not be looked at");
        let (curve, limits) = (Arc::clone(trajectory), self.limits);
        let own_links = self.own_links.clone();
        let looked = tokio::task::spawn_blocking(move || {
            if let Some(own_links) = own_links {
                own_links.check(&curve)?;
            }
            Readiness::of(&curve, &limits)
                .map_err(|error| Denial::new(DenialCode::Internal, error.to_string()))
        });
        looked.await.map_err(failed)?
    }

    fn check_partners(&self, params: &GroupParams) -> Result<(), Denial> {
        let own = self.board.lock().vocabulary.robot.clone();
        let refuse = |message: String| {
            Err(Denial::new(DenialCode::InvalidArgument, message).with("field", "group.partners"))
        };
        let mut known = BTreeSet::new();
        for partner in &params.partners {
            if *partner == own {
                return refuse(format!("{own} is named as its own partner"));
            }
            if !known.insert(partner) {
                return refuse(format!("partner {partner} is named twice"));
            }
        }
        match params.partners.len() {
            0 => refuse("partners is empty: leave group out for a robot alone".to_owned()),
            count if count > MAX_PARTNERS => {
                refuse(format!("{count} partners, at most {MAX_PARTNERS}"))
            }
            _ => Ok(()),
        }
    }

    fn check_times(&self, params: &GroupParams) -> Result<(), Denial> {
        let fields = [
            ("group.loss_ms", params.loss_ms as f64, LOSS_MS),
            ("group.max_divergence_ms", params.max_divergence_ms, DIVERGENCE_MS),
        ];
        for (field, value, (low, high)) in fields {
            if !(low..=high).contains(&value) {
                let text = format!("{field} is {value}, expected {low} to {high}");
                return Err(out_of_range(
                    field,
                    value,
                    if value > high { high } else { low },
                    text,
                ));
            }
        }
        // Two heartbeats and a tick have to come in that time, each read a tick later.
        let least_ms = (BEAT + self.params.period * 2).as_secs_f64() * 1e3;
        let loss_ms = params.loss_ms as f64;
        if loss_ms < least_ms {
            let text = format!(
                "group.loss_ms is {loss_ms}, a loop of {} ms needs {least_ms}",
                self.params.period.as_secs_f64() * 1e3
            );
            return Err(out_of_range("group.loss_ms", loss_ms, least_ms, text));
        }
        Ok(())
    }

    /// Revision of tools and payloads in force, if it is the one asked for in `field`.
    pub(super) fn check_model_rev(&self, asked: Option<u64>, field: &str) -> Result<u64, Denial> {
        let board = self.board.lock();
        let in_force = board.snapshot.config_seqno;
        let robot = &board.vocabulary.robot;
        match asked.filter(|&asked| asked != in_force) {
            None => Ok(in_force),
            Some(asked) => Err(Denial::new(
                DenialCode::StaleModel,
                format!(
                    "tools and payloads of {robot} have revision {in_force}, the motion was made \
                     for {asked}: plan it anew"
                ),
            )
            .with("field", field)
            .with("value", asked)
            .with("limit", in_force)),
        }
    }

    /// A rigid group needs room for its common ramp, and a soft start.
    fn check_rigid(
        &self,
        trajectory: &CompiledTrajectory,
        readiness: &Readiness,
        (start, window_s): (StartTravel, f64),
    ) -> Result<(), Denial> {
        if start.travel > RIGID_TRAVEL {
            let joint = self.joint_names.get(start.joint).map_or("?", String::as_str);
            let stretch = StartTravel::stretch(trajectory, window_s, RIGID_TRAVEL);
            let text = format!(
                "{joint} moves {:.4} until it rests if a partner is lost at the start, a rigid group \
                 allows {RIGID_TRAVEL}: start more softly, or take {:.2} times as long",
                start.travel,
                rounded_up(stretch)
            );
            return Err(out_of_range("trajectory", start.travel, RIGID_TRAVEL, text)
                .with("joint", joint)
                .with("stretch", stretch));
        }
        if readiness.rate_slope_s < RIGID_SLOPE_S {
            let stretch = stretch_for_slope(trajectory, &self.limits, RIGID_SLOPE_S);
            let slope = readiness.rate_slope_s;
            let text = format!(
                "the trajectory is so fast that its rate can change by {slope} per second only, a \
                 rigid group needs {RIGID_SLOPE_S}: take {:.2} times as long",
                rounded_up(stretch)
            );
            let denial = out_of_range("trajectory", slope, RIGID_SLOPE_S, text);
            return Err(denial.with("stretch", stretch));
        }
        Ok(())
    }
}

/// To two decimals, never too little.
fn rounded_up(stretch: f64) -> f64 {
    (stretch * 100.0).ceil() / 100.0
}

fn out_of_range(field: &str, value: f64, limit: f64, message: String) -> Denial {
    Denial::new(DenialCode::OutOfRange, message)
        .with("field", Value::from(field))
        .with("value", value)
        .with("limit", limit)
}
