//! One robot's part of a motion of several.

use std::time::Duration;

use armada_model::MonoTime;
use armada_protocol::messages::{Coupling, GroupQuality, GroupState};
use arrayvec::ArrayVec;
use serde::{Deserialize, Serialize};
use uuid::Uuid;

use super::pace::Pace;
use super::partner::Partner;
use super::scale::ScaleStep;
use super::trace::Trace;
use super::words::{Beat, GroupOrder, GroupSay, GroupWord, PartnerFault, Say};
use super::{BEAT, LINGER, MAX_PARTNERS, MAX_SAID};
use crate::control::io::Refusal;

/// How often an abort is said.
const REPEATS: u8 = 3;
/// How much slower than the common rate a robot goes at most while it waits for others.
const LEVEL_SHARE: f64 = 0.1;
/// How much slower it goes for each second that it is ahead \[1/s\].
const LEVEL_GAIN: f64 = 5.0;
/// How far ahead is level \[s\]: what clocks and ticks make of robots that are.
const LEVEL_S: f64 = 0.003;

/// One robot's part of a motion of several; see the head of the module.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupMachine {
    id: Uuid,
    order: GroupOrder,
    start: MonoTime,
    state: GroupState,
    partners: ArrayVec<Partner, MAX_PARTNERS>,
    /// What the own robot allows, as its partners know it.
    scale: ScaleStep,
    /// Speed ratio wanted of the own robot.
    ratio: f64,
    paused: bool,
    pace: Pace,
    trace: Trace,
    own: Own,
    /// Whether the own motion is in progress, or waits for its start.
    moves: bool,
    why: Option<Refusal>,
    /// Where the common ramp begins that ends a rigid group \[s\].
    ramp_from_s: Option<f64>,
    ended: MonoTime,
    quality: GroupQuality,
    seq: u64,
    next_beat: MonoTime,
    /// Whether there is something that partners have to know at once.
    changed: bool,
    /// How often it still says that it stops.
    left: u8,
}

/// Where the own robot is, at each tick.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Own {
    /// Its phase \[s\].
    pub phase_s: f64,
    /// How fast that runs.
    pub rate: f64,
    /// Largest tracking error over its tolerance, 0 to 1.
    pub error: f64,
    /// Period of its loop.
    pub period: Duration,
}

/// What the own robot is to do in this tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decision {
    /// Nothing new.
    Hold,
    /// Go, or go on, at its own pace.
    Free,
    /// Go, or go on, at this rate.
    Run {
        /// How fast its phase is to run.
        rate: f64,
        /// Whether the group is paused, or on the way to that.
        paused: bool,
    },
    /// Stop as it can.
    Stop(Refusal),
    /// The common ramp is over: the motion has ended.
    Rested(Refusal),
}

/// How a motion of several stands, for people.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GroupReport {
    /// The motion.
    pub id: Uuid,
    /// Where the own robot stands in it.
    pub state: GroupState,
    /// How well it kept together with its partners.
    pub quality: GroupQuality,
}

impl GroupMachine {
    /// Armed: to start at `start` if all partners are ready then, allowing the rate `ratio`.
    #[must_use]
    pub fn new(id: Uuid, order: &GroupOrder, start: MonoTime, ratio: f64) -> Self {
        let count = usize::from(order.partners).min(MAX_PARTNERS);
        let own = Own { phase_s: 0.0, rate: 0.0, error: 0.0, period: Duration::ZERO };
        Self {
            id,
            order: *order,
            start,
            state: GroupState::Armed,
            partners: std::iter::repeat_n(Partner::default(), count).collect(),
            scale: ScaleStep::steady(ratio),
            ratio,
            paused: false,
            pace: Pace::at(ratio),
            trace: Trace::default(),
            own,
            moves: true,
            why: None,
            ramp_from_s: None,
            ended: MonoTime::default(),
            quality: GroupQuality::default(),
            seq: 0,
            next_beat: MonoTime::default(),
            changed: true,
            left: REPEATS,
        }
    }

    /// Takes something a partner said; what is about another motion does not count.
    pub fn hear(&mut self, word: &GroupWord) {
        let at_s = self.time_s(word.at);
        if word.group == self.id
            && let Some(partner) = self.partners.get_mut(usize::from(word.partner))
        {
            partner.hear(&word.word, word.at, at_s);
        }
    }

    /// What the own robot is to do in the tick `now`; before its set-point is made.
    pub fn guide(&mut self, now: MonoTime, own: &Own) -> Decision {
        let time_s = self.time_s(now);
        self.own = *own;
        match self.state {
            GroupState::Armed => self.guide_armed(now, time_s),
            GroupState::Running => self.guide_running(now, time_s),
            GroupState::Aborting if self.ramp_from_s.is_some() => self.ramp_down(time_s),
            GroupState::Aborting | GroupState::Done => Decision::Hold,
        }
    }

    /// The own motion is to end early, for a reason of its own. Returns whether it goes on for that
    /// on the common ramp, at whose end [`Decision::Rested`] says so; else it is over now.
    ///
    /// The ramp begins `lead` later if all goes well, so that partners hear of it before they are
    /// there; if they do not, they catch up with it.
    pub fn leave(&mut self, why: Refusal, lead: Duration) -> bool {
        if self.order.coupling != Coupling::Rigid || self.state != GroupState::Running {
            return self.ramp_from_s.is_some() && self.moves;
        }
        let ahead_s = lead.as_secs_f64() * self.own.rate;
        self.abort(why, Some(self.own.phase_s + ahead_s));
        true
    }

    /// The own motion has ended: at its goal, or early for a reason.
    pub fn end(&mut self, now: MonoTime, why: Option<Refusal>) {
        match (self.state, why) {
            (GroupState::Armed | GroupState::Running, None) => {
                (self.state, self.changed) = (GroupState::Done, true);
            }
            (GroupState::Armed | GroupState::Running, Some(why)) => self.abort(why, None),
            (GroupState::Aborting | GroupState::Done, _) => {}
        }
        if self.moves {
            (self.moves, self.left, self.ended) = (false, REPEATS, now);
            self.own.rate = 0.0;
        }
    }

    /// The common ramp on which the own robot ends early is over for it, whether it led to its end.
    pub fn rest(&mut self, now: MonoTime) {
        if self.state == GroupState::Aborting && self.moves {
            (self.moves, self.left, self.ended) = (false, REPEATS, now);
            self.own.rate = 0.0;
        }
    }

    /// How long the common ramp takes from here at most \[s\]; none if there is none.
    #[must_use]
    pub fn ramp_s(&self) -> Option<f64> {
        let rigid = self.order.coupling == Coupling::Rigid && self.order.rate_slope_s > 0.0;
        // Who is ahead of others goes slower, until they are level.
        rigid.then(|| self.pace.rate() / self.order.rate_slope_s / (1.0 - LEVEL_SHARE))
    }

    /// Brings all robots to rest on their paths, or lets them go on as far as this one is concerned.
    pub const fn set_paused(&mut self, paused: bool) {
        self.paused = paused;
    }

    /// Changes the rate that the own robot allows.
    pub const fn set_ratio(&mut self, ratio: f64) {
        self.ratio = ratio;
    }

    /// What is to be said to all partners after the tick `now`, whose set-point is that at `phase_s`.
    ///
    /// Compared is where robots are after their ticks: before them each is behind by a period, and
    /// the periods of robots differ.
    pub fn poll(&mut self, now: MonoTime, phase_s: f64) -> ArrayVec<GroupSay, MAX_SAID> {
        let mut said = ArrayVec::new();
        self.trace.note(self.time_s(now), phase_s, self.pace.rate());
        if self.is_over(now) || !(self.changed || now >= self.next_beat) {
            return said;
        }
        let regular = self.next_beat + BEAT;
        self.next_beat = if self.changed || regular <= now { now + BEAT } else { regular };
        self.changed = false;
        let beat = self.beat(now, phase_s);
        let (group, from_phase_s) = (self.id, self.ramp_from_s);
        let first = match (self.state, self.why) {
            (GroupState::Armed, _) => Some(Say::Go),
            (GroupState::Aborting, Some(why)) => Some(Say::Abort { why, from_phase_s }),
            _ => None,
        };
        if self.state == GroupState::Aborting && !self.moves {
            self.left = self.left.saturating_sub(1);
        }
        said.extend(first.map(|say| GroupSay { group, say }));
        // There is room for two.
        said.push(GroupSay { group, say: Say::Heartbeat(beat) });
        said
    }

    /// Whether there is nothing to be said any more.
    #[must_use]
    pub fn is_over(&self, now: MonoTime) -> bool {
        match self.state {
            GroupState::Armed | GroupState::Running => false,
            GroupState::Aborting => !self.moves && self.left == 0,
            GroupState::Done => {
                let all = self.partners.iter().all(Partner::has_ended);
                !self.changed && (all || now.saturating_since(self.ended) >= LINGER)
            }
        }
    }

    /// Which motion it is.
    #[must_use]
    pub const fn id(&self) -> Uuid {
        self.id
    }

    /// Phase \[s\] at which the tick before it found the own robot.
    #[must_use]
    pub const fn phase_s(&self) -> f64 {
        self.own.phase_s
    }

    /// How it stands.
    #[must_use]
    pub const fn report(&self) -> GroupReport {
        GroupReport { id: self.id, state: self.state, quality: self.quality }
    }

    fn guide_armed(&mut self, now: MonoTime, time_s: f64) -> Decision {
        if let Some(fault) = self.aborted() {
            return self.stop(fault, None);
        }
        self.announce(time_s);
        if now < self.start {
            return Decision::Hold;
        }
        if let Some(fault) = self.missing(now, time_s) {
            return self.stop(fault, None);
        }
        (self.state, self.changed) = (GroupState::Running, true);
        self.pace = Pace::at(self.target(time_s).0);
        self.run()
    }

    fn guide_running(&mut self, now: MonoTime, time_s: f64) -> Decision {
        if let Some(fault) = self.aborted() {
            let from_s = self.partners.iter().filter_map(|partner| partner.ramp_from_s);
            return self.stop(fault, from_s.reduce(f64::min).map(|from_s| self.near(from_s)));
        }
        if let Some(fault) = self.silent(now, time_s) {
            return self.stop(fault, None);
        }
        if let Some(fault) = self.compare() {
            return self.stop(fault, None);
        }
        if self.order.coupling == Coupling::Independent {
            return Decision::Free;
        }
        self.announce(time_s);
        let (target, from_s) = self.target(time_s);
        self.follow(target, from_s);
        self.run()
    }

    /// On the common ramp that ends a rigid group, from the first place that any robot lets it begin:
    /// those that are stopped one after the other come to rest at one place.
    fn ramp_down(&mut self, time_s: f64) -> Decision {
        let mut from_s = self.ramp_from_s.unwrap_or_default();
        let named = self.partners.iter().filter_map(|partner| partner.ramp_from_s);
        if let Some(sooner_s) = named.map(|named_s| self.near(named_s)).reduce(f64::min)
            && sooner_s < from_s
        {
            from_s = sooner_s;
            self.ramp_from_s = Some(sooner_s);
            self.pace.fall_from(sooner_s);
        }
        let (target, from_s) = match self.own.phase_s >= from_s {
            true => (0.0, from_s),
            false => self.target(time_s),
        };
        self.follow(target, from_s);
        match self.why {
            Some(why) if self.own.rate == 0.0 && self.pace.rate() == 0.0 => Decision::Rested(why),
            _ => self.run(),
        }
    }

    fn follow(&mut self, target: f64, from_s: f64) {
        let steepness = (self.order.rate_slope_s, self.own.period.as_secs_f64());
        self.pace.follow(target, from_s, self.own.phase_s, steepness);
    }

    /// The common rate, or a little less while others are behind.
    fn run(&self) -> Decision {
        if self.order.coupling == Coupling::Independent {
            return Decision::Free;
        }
        let running = self.partners.iter().filter(|partner| !partner.has_ended());
        let ahead_s = running.map(|partner| partner.ahead_s).fold(0.0, f64::max);
        let slower = (LEVEL_GAIN * (ahead_s - LEVEL_S)).clamp(0.0, LEVEL_SHARE);
        let rate = self.pace.rate() * (1.0 - slower);
        Decision::Run { rate, paused: self.pace.target() == 0.0 }
    }

    /// Stops for something a partner did: on the common ramp from `from_s` \[s\] if the group is rigid
    /// and under way.
    fn stop(&mut self, (partner, fault): (u8, PartnerFault), from_s: Option<f64>) -> Decision {
        let why = Refusal::Partner { group: self.id, partner, fault };
        let rigid = self.order.coupling == Coupling::Rigid && self.state == GroupState::Running;
        self.abort(why, rigid.then(|| from_s.unwrap_or(self.own.phase_s)));
        if rigid { self.run() } else { Decision::Stop(why) }
    }

    /// The place where a partner lets the common ramp begin, or the nearest one where it can have
    /// meant it to: ahead by its lead, back by what the word may take, and as far off the own phase
    /// as robots of a group may be. No word makes a robot go on, or rest at once.
    fn near(&self, from_s: f64) -> f64 {
        let (phase_s, apart_s) = (self.own.phase_s, self.order.max_divergence_s);
        let (late_s, lead_s) = (self.order.loss.as_secs_f64(), BEAT.as_secs_f64());
        from_s.clamp(phase_s - late_s - apart_s, phase_s + lead_s + apart_s)
    }

    const fn abort(&mut self, why: Refusal, ramp_from_s: Option<f64>) {
        self.state = GroupState::Aborting;
        self.why = Some(why);
        self.ramp_from_s = ramp_from_s;
        self.changed = true;
    }

    /// Announces what the own robot allows, if that is to change and the change before is over.
    fn announce(&mut self, time_s: f64) {
        let wanted = if self.paused { 0.0 } else { self.ratio };
        if wanted == self.scale.after {
            return;
        }
        let own = self.own;
        let before = self.scale.at(own.phase_s, time_s);
        let lead_s = self.lead_s();
        let (target, _) = self.target(time_s);
        self.scale = if self.rests() {
            let (from_s, at_s) = (own.phase_s + lead_s, Some(time_s + lead_s));
            ScaleStep { before, after: wanted, from_s, at_s }
        } else if target > 0.0 && self.is_resolved(time_s) {
            let from_s = own.phase_s + lead_s * target.max(own.rate);
            ScaleStep { before, after: wanted, from_s, at_s: None }
        } else {
            return;
        };
        self.changed = true;
    }

    /// How long before it counts a step is announced \[s\]: until then each partner has heard it, or
    /// noticed that it heard nothing. One whose start was shifted is there sooner.
    fn lead_s(&self) -> f64 {
        let sooner = self.partners.iter().map(|partner| -partner.base_s);
        (self.order.loss + BEAT).as_secs_f64() + sooner.fold(0.0, f64::max)
    }

    /// Whether all robots have come past the step that was announced last.
    fn is_resolved(&self, time_s: f64) -> bool {
        let step = &self.scale;
        step.is_in_force(self.own.phase_s, time_s)
            && self.partners.iter().all(|partner| {
                let past = |beat: Beat| step.is_in_force(beat.phase_s, beat.time_s);
                partner.has_ended() || partner.beat.is_some_and(past)
            })
    }

    /// Whether all robots rest, in a pause.
    fn rests(&self) -> bool {
        let own = self.own.rate == 0.0 && self.pace.rate() == 0.0 && self.pace.target() == 0.0;
        self.state == GroupState::Running
            && own
            && self.partners.iter().all(|partner| partner.has_ended() || partner.rests())
    }

    /// The rate that all robots allow where the own one is, and from which phase on \[s\].
    fn target(&self, time_s: f64) -> (f64, f64) {
        let phase_s = self.own.phase_s;
        let partners = self.partners.iter().filter_map(|partner| Some(partner.beat?.scale));
        let steps = std::iter::once(self.scale).chain(partners);
        steps.fold((1.0, phase_s), |(least, from_s), step| {
            let scale = step.at(phase_s, time_s);
            match scale < least {
                true => (scale, step.from_s.min(phase_s)),
                false => (least, from_s),
            }
        })
    }

    /// The first partner that stops.
    fn aborted(&self) -> Option<(u8, PartnerFault)> {
        self.first(|partner| partner.aborted.then_some(PartnerFault::Aborted))
    }

    /// The first partner that is not ready to start.
    fn missing(&self, now: MonoTime, time_s: f64) -> Option<(u8, PartnerFault)> {
        let loss_s = self.order.loss.as_secs_f64();
        self.first(|partner| match partner.silence_s(now, time_s) {
            Some(silence_s) if partner.go => {
                (silence_s > loss_s).then_some(PartnerFault::Silent(silence_s))
            }
            _ => Some(PartnerFault::NotReady),
        })
    }

    /// The first partner that was not heard for too long.
    fn silent(&mut self, now: MonoTime, time_s: f64) -> Option<(u8, PartnerFault)> {
        let loss_s = self.order.loss.as_secs_f64();
        let mut longest_s = 0.0_f64;
        let found = self.first(|partner| {
            let silence_s = partner.silence_s(now, time_s).filter(|_| !partner.has_ended())?;
            longest_s = longest_s.max(silence_s);
            (silence_s > loss_s).then_some(PartnerFault::Silent(silence_s))
        });
        self.quality.max_silence_ms = self.quality.max_silence_ms.max(longest_s * 1e3);
        found
    }

    /// Compares the own phase with what partners have said since the last tick.
    fn compare(&mut self) -> Option<(u8, PartnerFault)> {
        for partner in &mut self.partners {
            let Some(beat) = partner.beat.filter(|_| std::mem::take(&mut partner.is_new)) else {
                continue;
            };
            let own_s = self.trace.phase_at(beat.time_s, self.own.rate);
            if let Some(own_s) = own_s.filter(|_| !partner.has_ended() && beat.time_s > 0.0) {
                partner.ahead_s = own_s - beat.phase_s;
                let apart_ms = partner.ahead_s.abs() * 1e3;
                self.quality.max_divergence_ms = self.quality.max_divergence_ms.max(apart_ms);
            }
        }
        let limit_s = self.order.max_divergence_s;
        self.first(|partner| {
            let apart_s = partner.ahead_s.abs();
            (apart_s > limit_s && !partner.has_ended()).then_some(PartnerFault::Diverged(apart_s))
        })
    }

    fn first(
        &self,
        mut fault: impl FnMut(&Partner) -> Option<PartnerFault>,
    ) -> Option<(u8, PartnerFault)> {
        (0..).zip(&self.partners).find_map(|(index, partner)| Some((index, fault(partner)?)))
    }

    fn beat(&mut self, now: MonoTime, phase_s: f64) -> Beat {
        self.seq += 1;
        let Own { rate, error, .. } = self.own;
        let (state, time_s, scale) = (self.state, self.time_s(now), self.scale);
        Beat { seq: self.seq, state, time_s, phase_s, rate, error, scale }
    }

    fn time_s(&self, now: MonoTime) -> f64 {
        now.saturating_since(self.start).as_secs_f64()
            - self.start.saturating_since(now).as_secs_f64()
    }
}
