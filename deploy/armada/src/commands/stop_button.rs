//! `armada stop-button`: a source of stops that has to check in.
//!
//! It begins pressed, for nobody has said otherwise, and is pressed again when its input ends. When
//! this program ends the robots hear nothing, which is a press. Zenoh answers them from threads of its
//! own, so a picture that hangs, or lines that stop coming where they are to be repeated, has to be
//! seen here: that is a press too.

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::Context as _;
use armada_protocol::RobotName;
use armada_protocol::client::AnsweredStopSource;
use armada_protocol::signature::SigningKey;
use clap::{Args, ValueHint};
use ratatui::crossterm::event::{self, Event, KeyCode, KeyEventKind, KeyModifiers};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use ratatui::{DefaultTerminal, Frame};
use tokio::io::{AsyncBufReadExt as _, BufReader};
use tokio::sync::watch;

use crate::cell_address::CellArgs;
use crate::clock;
use crate::exit::{Exit, UsageError};
use crate::output::note;
use crate::signals::Signals;

/// Time between pictures.
const FRAME: Duration = Duration::from_millis(100);
/// A robot that has not asked for so long is not there any more, and a picture that is older shows
/// nothing.
const SILENT: Duration = Duration::from_millis(500);

/// What `armada stop-button --help` begins with.
pub(crate) const LONG_ABOUT: &str = "Be a source of stops for robots whose files name it.

Such a robot asks again and again whether the button is pressed. If it is, or if no answer comes for \
half a second, it stops and stays stopped until a reset, which needs the button released and heard.

THIS IS AN OPERATIONAL STOP OVER A NETWORK, NEVER A RATED SAFETY FUNCTION. It does not replace the \
emergency stop of a robot: where people can be hurt, press that.";

/// Arguments of `armada stop-button`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada stop-button --name door_1                        keys: space presses, r releases, q ends
  read-door-switch | armada stop-button --name door_1 --stdin-level --repeat 0.2

It begins pressed. With --stdin-level a line `pressed` or `released` is what a real input says, said
again all the time; anything else, silence, and the end of the input are a press. With --repeat never
a line counts until the next one: nobody sees then that the program before it hangs. When this program
ends, that is a press too.")]
pub(crate) struct StopButtonArgs {
    /// Name of the source, as in the robot files
    #[arg(long, value_name = "NAME", value_parser = parse_name)]
    name: String,
    /// Follow lines `pressed` and `released` on standard input instead of keys
    #[arg(long)]
    stdin_level: bool,
    /// With --stdin-level: a line has to come so often, else the button counts as pressed; `never` to
    /// let the last one count for ever
    #[arg(
        long,
        value_name = "SECONDS",
        requires = "stdin_level",
        value_parser = parse_repeat,
        default_value = "0.5"
    )]
    repeat: Repeat,
    /// File with the key that check-ins are signed with, as in the robot files
    #[arg(long, value_name = "FILE", value_hint = ValueHint::FilePath)]
    key_file: Option<PathBuf>,
    #[command(flatten)]
    cell: CellArgs,
}

fn parse_name(text: &str) -> Result<String, String> {
    let named: Result<RobotName, _> = text.parse();
    let rule =
        "is not the name of a stop source: 1 to 64 of a-z, 0-9 and _, beginning with a letter";
    named.map(|_| text.to_owned()).map_err(|_| rule.to_owned())
}

/// How often a line has to come; it need not if there is no time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Repeat(Option<Duration>);

fn parse_repeat(text: &str) -> Result<Repeat, String> {
    if text == "never" {
        return Ok(Repeat(None));
    }
    match text.parse::<f64>() {
        Ok(seconds) if (0.05..=10.0).contains(&seconds) => {
            Ok(Repeat(Some(Duration::from_secs_f64(seconds))))
        }
        _ => Err("must be a number of seconds from 0.05 to 10, or never".to_owned()),
    }
}

/// The button: pressed or not, and when somebody has said so last.
#[derive(Debug)]
struct Level {
    said: Mutex<(bool, Instant)>,
    /// How long what was said counts; for ever if none.
    patience: Option<Duration>,
}

impl Level {
    fn new(patience: Option<Duration>) -> Self {
        Self { said: Mutex::new((true, clock::now())), patience }
    }

    fn is_pressed(&self) -> bool {
        let (pressed, at) = *self.said.lock().unwrap_or_else(PoisonError::into_inner);
        let age = clock::now().saturating_duration_since(at);
        pressed || self.patience.is_some_and(|patience| age > patience)
    }

    fn set(&self, pressed: bool) {
        *self.said.lock().unwrap_or_else(PoisonError::into_inner) = (pressed, clock::now());
    }

    /// Says the same again.
    fn repeat(&self) {
        self.said.lock().unwrap_or_else(PoisonError::into_inner).1 = clock::now();
    }
}

/// Answers until it is ended.
pub(crate) async fn run(args: StopButtonArgs) -> anyhow::Result<Exit> {
    if !args.stdin_level && !std::io::stdin().is_terminal() {
        let text = "standard input is no terminal: give --stdin-level to follow its lines";
        return Err(UsageError(text.to_owned()).into());
    }
    let key = args.key_file.as_deref().map(SigningKey::read).transpose()?;
    let mut signals = Signals::new()?;
    let client = args.cell.address()?.connect_for_stop().await?;
    let level = Level::new(if args.stdin_level { args.repeat.0 } else { Some(SILENT) });
    let level = Arc::new(level);
    let read = Arc::clone(&level);
    let read = move || read.is_pressed();
    let source = client.answer_stop_source(&args.name, key, read).await?;
    if args.stdin_level {
        follow_lines(&level, &mut signals).await;
    } else {
        let terminal = ratatui::try_init().context("the terminal cannot be drawn on")?;
        let restored = Restored;
        let shown = show(terminal, &args.name, &level, &source, &mut signals).await;
        drop(restored);
        shown?;
    }
    note(format_args!("{} ends: robots that ask for it stop", args.name));
    Ok(Exit::Success)
}

async fn follow_lines(level: &Level, signals: &mut Signals) {
    let mut lines = BufReader::new(tokio::io::stdin()).lines();
    loop {
        let line = tokio::select! {
            line = lines.next_line() => line,
            _ = signals.next() => return,
        };
        let pressed = match line {
            Ok(Some(line)) => level_of(&line),
            Ok(None) | Err(_) => break,
        };
        if level.is_pressed() != pressed {
            note(if pressed { "pressed" } else { "released" });
        }
        level.set(pressed);
    }
    level.set(true);
    note("the input has ended: pressed");
    signals.next().await;
}

/// What a line says; anything but `released` is a press.
fn level_of(line: &str) -> bool {
    line.trim() != "released"
}

/// Restores the terminal when dropped, also on an error.
struct Restored;

impl Drop for Restored {
    fn drop(&mut self) {
        ratatui::restore();
    }
}

async fn show(
    mut terminal: DefaultTerminal,
    name: &str,
    level: &Arc<Level>,
    source: &AnsweredStopSource,
    signals: &mut Signals,
) -> anyhow::Result<()> {
    let (ends, mut ended) = watch::channel(false);
    let keys = Arc::clone(level);
    tokio::task::spawn_blocking(move || follow_keys(&keys, &ends));
    let mut frames = tokio::time::interval(FRAME);
    loop {
        tokio::select! {
            _ = signals.next() => return Ok(()),
            // The reader of the keyboard ends by `q`, or because there is no keyboard any more.
            _ = ended.changed() => return Ok(()),
            _ = frames.tick() => {}
        }
        let pressed = level.is_pressed();
        let lines = picture(name, pressed, &source.asking());
        let draw = |frame: &mut Frame<'_>| {
            frame.render_widget(Paragraph::new(lines), frame.area());
        };
        terminal.draw(draw).context("the terminal cannot be drawn on")?;
        // Whoever looks at the picture sees what robots are told.
        level.repeat();
    }
}

/// Follows the keyboard until `q`; a keyboard that fails is a press.
fn follow_keys(level: &Level, ends: &watch::Sender<bool>) {
    loop {
        match event::read().map(|event| action_of(&event)) {
            Ok(Some(Action::Press)) => level.set(true),
            Ok(Some(Action::Release)) => level.set(false),
            Ok(None) => {}
            Ok(Some(Action::Quit)) | Err(_) => {
                level.set(true);
                ends.send_replace(true);
                return;
            }
        }
    }
}

/// What a key asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Action {
    Press,
    Release,
    Quit,
}

const fn action_of(event: &Event) -> Option<Action> {
    let Event::Key(key) = event else { return None };
    if !matches!(key.kind, KeyEventKind::Press) {
        return None;
    }
    match key.code {
        KeyCode::Char('c') if key.modifiers.contains(KeyModifiers::CONTROL) => Some(Action::Quit),
        KeyCode::Char(' ') => Some(Action::Press),
        KeyCode::Char('r' | 'R') if key.modifiers.is_empty() => Some(Action::Release),
        KeyCode::Char('q' | 'Q') | KeyCode::Esc => Some(Action::Quit),
        _ => None,
    }
}

fn picture(name: &str, pressed: bool, asking: &[(RobotName, Duration)]) -> Vec<Line<'static>> {
    let (word, color) =
        if pressed { (" PRESSED ", Color::Red) } else { (" RELEASED ", Color::Green) };
    let style = Style::new().bg(color).fg(Color::Black).add_modifier(Modifier::BOLD);
    let mut lines = vec![
        Line::from(format!("stop button {name}")),
        Line::default(),
        Line::from(Span::styled(word, style)),
        Line::default(),
    ];
    let there = asking.iter().filter(|(_, ago)| *ago < SILENT).count();
    lines.push(Line::from(if there == 0 {
        "NO ROBOT ASKS: nothing is stopped by this button now".to_owned()
    } else {
        "robots that ask:".to_owned()
    }));
    for (robot, ago) in asking {
        let how = if *ago < SILENT { "" } else { "  ASKS NO MORE" };
        lines.push(Line::from(format!("  {robot}  {} ms ago{how}", ago.as_millis())));
    }
    lines.push(Line::default());
    lines.push(Line::from("space press   r release   q end, which is a press"));
    lines.push(Line::from("An operational stop over a network, never a rated safety function."));
    lines
}

#[cfg(test)]
mod tests {
    use ratatui::crossterm::event::KeyEvent;

    use super::*;

    fn key(code: KeyCode, modifiers: KeyModifiers) -> Option<Action> {
        action_of(&Event::Key(KeyEvent::new(code, modifiers)))
    }

    #[test]
    fn space_presses_and_only_a_plain_r_releases() {
        assert_eq!(key(KeyCode::Char(' '), KeyModifiers::NONE), Some(Action::Press));
        assert_eq!(key(KeyCode::Char(' '), KeyModifiers::CONTROL), Some(Action::Press));
        assert_eq!(key(KeyCode::Char('r'), KeyModifiers::NONE), Some(Action::Release));
        assert_eq!(key(KeyCode::Char('r'), KeyModifiers::CONTROL), None);
        assert_eq!(key(KeyCode::Char('x'), KeyModifiers::NONE), None);
        assert_eq!(key(KeyCode::Char('c'), KeyModifiers::CONTROL), Some(Action::Quit));
    }

    #[test]
    fn what_nobody_says_again_in_time_is_a_press() {
        let level = Level::new(Some(Duration::from_millis(20)));
        assert!(level.is_pressed(), "at first");
        level.set(false);
        let begin = clock::now();
        while !level.is_pressed() {
            assert!(clock::now() - begin < Duration::from_secs(5), "it never is");
            std::thread::yield_now();
        }
        let level = Level::new(None);
        level.set(false);
        assert!(!level.is_pressed(), "one that is said once");
    }

    #[test]
    fn lines_have_to_be_repeated_unless_somebody_says_never() {
        assert_eq!(parse_repeat("0.2"), Ok(Repeat(Some(Duration::from_millis(200)))));
        assert_eq!(parse_repeat("never"), Ok(Repeat(None)));
        for bad in ["0.01", "11", "NaN", "always", ""] {
            assert!(parse_repeat(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_line_that_is_not_understood_is_a_press() {
        assert!(!level_of("released"));
        assert!(!level_of(" released\r"));
        for line in ["pressed", "", "Released", "release", "0"] {
            assert!(level_of(line), "{line:?}");
        }
    }

    #[test]
    fn whoever_looks_sees_that_nobody_asks() {
        let text = |asking: &[(RobotName, Duration)]| {
            let lines = picture("door_1", true, asking);
            lines.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
        };
        assert!(text(&[]).contains("NO ROBOT ASKS"));
        let robot: RobotName = "left_arm".parse().expect("a name");
        let asks = text(&[(robot.clone(), Duration::from_millis(40))]);
        assert!(asks.contains("left_arm  40 ms ago") && asks.contains("PRESSED"), "{asks}");
        assert!(text(&[(robot, Duration::from_secs(2))]).contains("ASKS NO MORE"));
    }
}
