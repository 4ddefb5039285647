//! `armada completions`.

use clap::{Args, CommandFactory as _};
use clap_complete::Shell;

use crate::cli::Cli;
use crate::exit::Exit;
use crate::output::Output;

/// Arguments of `armada completions`.
#[derive(Args, Debug)]
#[command(after_help = "Examples:
  armada completions bash > ~/.local/share/bash-completion/completions/armada
  armada completions zsh > ~/.zfunc/_armada
  armada completions fish > ~/.config/fish/completions/armada.fish")]
pub(crate) struct CompletionsArgs {
    /// Which shell
    #[arg(value_enum)]
    shell: Shell,
}

/// Writes the script.
pub(crate) fn run(args: &CompletionsArgs) -> anyhow::Result<Exit> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut Cli::command(), "armada", &mut script);
    Output::new(false).write(&script)?;
    Ok(Exit::Success)
}
