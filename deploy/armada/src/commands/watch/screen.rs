//! The terminal: keys in, pictures out, and put back as it was whatever happens.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Context as _;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use tokio::sync::mpsc;
use tokio::time::MissedTickBehavior;

use super::feed::{Asker, Feed};
use super::render::render;
use crate::exit::Exit;

/// Time between pictures.
const FRAME: Duration = Duration::from_millis(50);
/// How long the keyboard's reader waits before it looks whether it is still wanted.
const KEY_POLL: Duration = Duration::from_millis(100);

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    Quit,
    Halt,
    Stop,
    Help,
    Redraw,
}

/// Shows the robot until `q` or Ctrl-C.
pub(super) async fn run(feed: Feed) -> anyhow::Result<Exit> {
    // Sets a panic hook as well that restores the terminal.
    let terminal = ratatui::try_init().context("the terminal cannot be drawn on")?;
    let _restored = Restored;
    show(terminal, feed).await
}

/// Restores the terminal when dropped, also on an error.
struct Restored;

impl Drop for Restored {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

async fn show(mut terminal: DefaultTerminal, mut feed: Feed) -> anyhow::Result<Exit> {
    let (mut keys, _reader) = read_keys();
    let (tell, mut told) = mpsc::channel(8);
    let mut frames = tokio::time::interval(FRAME);
    frames.set_missed_tick_behavior(MissedTickBehavior::Skip);
    loop {
        tokio::select! {
            action = keys.recv() => match action {
                None | Some(Action::Quit) => return Ok(Exit::Success),
                Some(Action::Help) => feed.model.help = !feed.model.help,
                Some(Action::Redraw) => {}
                Some(Action::Halt) => {
                    "halt: sent".clone_into(&mut feed.model.message);
                    start(feed.asker(), Asker::halt, tell.clone());
                }
                Some(Action::Stop) => {
                    "STOP: sent".clone_into(&mut feed.model.message);
                    start(feed.asker(), Asker::stop, tell.clone());
                }
            },
            Some(message) = told.recv() => feed.model.message = message,
            _ = frames.tick() => {}
        }
        feed.update().await?;
        let now = feed.now();
        terminal
            .draw(|frame| render(frame, &feed.model, now))
            .context("the terminal cannot be drawn on")?;
    }
}

/// Asks the robot while drawing goes on.
#[expect(clippy::disallowed_methods, reason = "a command line is runtime code")]
fn start<F>(asker: Asker, ask: impl FnOnce(Asker) -> F, tell: mpsc::Sender<String>)
where
    F: Future<Output = String> + Send + 'static,
{
    let asked = ask(asker);
    tokio::spawn(async move {
        // When the screen is gone there is nobody to tell.
        drop(tell.send(asked.await).await);
    });
}

/// Ends the keyboard's reader when dropped.
struct Reader(Arc<AtomicBool>);

impl Drop for Reader {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

fn read_keys() -> (mpsc::Receiver<Action>, Reader) {
    let (sender, receiver) = mpsc::channel(16);
    let over = Arc::new(AtomicBool::new(false));
    let reader = Reader(Arc::clone(&over));
    tokio::task::spawn_blocking(move || {
        while !over.load(Ordering::Relaxed) {
            let event = match event::poll(KEY_POLL) {
                Ok(false) => continue,
                Ok(true) => event::read(),
                Err(error) => Err(error),
            };
            // Without a keyboard there is no way to quit: the closed channel ends the screen.
            let Ok(event) = event else { return };
            if let Some(action) = action_of(&event)
                && sender.blocking_send(action).is_err()
            {
                return;
            }
        }
    });
    (receiver, reader)
}

const fn action_of(event: &Event) -> Option<Action> {
    let key = match event {
        Event::Resize(..) => return Some(Action::Redraw),
        Event::Key(key) => key,
        _ => return None,
    };
    if !matches!(key.kind, KeyEventKind::Press) {
        return None;
    }
    if key.modifiers.contains(KeyModifiers::CONTROL) {
        return if matches!(key.code, KeyCode::Char('c')) { Some(Action::Quit) } else { None };
    }
    match key.code {
        KeyCode::Char('s' | 'S') => Some(Action::Stop),
        KeyCode::Char('h' | 'H') => Some(Action::Halt),
        KeyCode::Char('?') => Some(Action::Help),
        KeyCode::Char('q' | 'Q') | KeyCode::Esc => Some(Action::Quit),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use ratatui::crossterm::event::KeyEvent;

    use super::*;

    fn press(code: KeyCode, modifiers: KeyModifiers) -> Option<Action> {
        action_of(&Event::Key(KeyEvent::new(code, modifiers)))
    }

    #[test]
    fn the_stop_key_works_with_caps_lock() {
        assert_eq!(press(KeyCode::Char('s'), KeyModifiers::NONE), Some(Action::Stop));
        assert_eq!(press(KeyCode::Char('S'), KeyModifiers::SHIFT), Some(Action::Stop));
    }

    #[test]
    fn ctrl_c_quits_and_other_control_keys_do_nothing() {
        assert_eq!(press(KeyCode::Char('c'), KeyModifiers::CONTROL), Some(Action::Quit));
        assert_eq!(press(KeyCode::Char('s'), KeyModifiers::CONTROL), None);
    }

    #[test]
    fn a_new_size_is_drawn_at_once() {
        assert_eq!(action_of(&Event::Resize(1, 1)), Some(Action::Redraw));
    }
}
