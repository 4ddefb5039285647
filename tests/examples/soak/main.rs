//! A soak: two arms on hosts of their own move together while processes and links fail at random.
//!
//! `make soak`, or `target/release/examples/soak --minutes 30 --seed 7`. The same seed gives the same
//! failures in the same order. It ends with a summary, and in error at the first thing that must not
//! be: an arm that goes on without its partner, a motion without a lease, a motion whose end nobody
//! tells, memory that grows.

#![allow(clippy::print_stdout, reason = "a program of its own")]
#![allow(clippy::expect_used, clippy::panic, reason = "it fails by panicking, as a test does")]

mod chance;
mod failure;
mod memory;
mod session;
#[allow(dead_code, reason = "the soak uses some of it")]
#[path = "../../suite/matrix/support.rs"]
mod support;

use std::time::Duration;

use anyhow::{Context, Result, bail};
use armada_tests::{can_make_hosts, in_network};

use session::Soak;

/// What was asked for.
#[derive(Clone, Copy, Debug)]
struct Arguments {
    minutes: f64,
    seed: u64,
}

fn main() -> Result<()> {
    let arguments = parse(std::env::args().skip(1))?;
    if let Err(why) = can_make_hosts() {
        bail!("the soak needs {why}");
    }
    println!("soak of {} minutes, seed {}", arguments.minutes, arguments.seed);
    in_network("the soak", async move |network| {
        let time = Duration::from_secs_f64(arguments.minutes * 60.0);
        let mut soak = Soak::start(network, arguments.seed).await?;
        let ran = soak.run(time).await;
        println!("{}", soak.summary());
        ran.with_context(|| format!("seed {}", arguments.seed))
    })
}

fn parse(mut words: impl Iterator<Item = String>) -> Result<Arguments> {
    let mut arguments = Arguments { minutes: 5.0, seed: 1 };
    while let Some(word) = words.next() {
        let value = words.next().with_context(|| format!("{word} needs a value"))?;
        match word.as_str() {
            "--minutes" => arguments.minutes = value.parse().context("--minutes")?,
            "--seed" => arguments.seed = value.parse().context("--seed")?,
            _ => bail!("{word}: there are --minutes NUMBER and --seed NUMBER"),
        }
    }
    Ok(arguments)
}
