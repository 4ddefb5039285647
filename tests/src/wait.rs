//! Waiting for a condition, never for a time.

use std::future::Future;
use std::time::Duration;

use anyhow::{Result, bail};

/// How long a condition may take on a busy machine.
pub const DEADLINE: Duration = Duration::from_secs(30);

/// Pause between two looks, so that the wait does not starve what it waits for.
const PAUSE: Duration = Duration::from_millis(10);

/// The first `Some` that `look` returns; `what` is for the error if none comes in time.
///
/// # Errors
/// If the deadline passes.
pub async fn wait_for<T, F, W>(what: &str, deadline: Duration, mut look: F) -> Result<T>
where
    F: FnMut() -> W,
    W: Future<Output = Option<T>>,
{
    let looking = async {
        loop {
            if let Some(found) = look().await {
                return found;
            }
            tokio::time::sleep(PAUSE).await;
        }
    };
    match tokio::time::timeout(deadline, looking).await {
        Ok(found) => Ok(found),
        Err(_) => bail!("{what}: not within {deadline:?}"),
    }
}
