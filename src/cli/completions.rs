//! `firn completions`: what makes a shell complete commands and options.

use clap::{Args, CommandFactory};
use clap_complete::Shell;

use super::{Cli, Failure};

/// Shown below the options.
pub const EXAMPLES: &str = "\
Examples:
  firn completions bash > ~/.local/share/bash-completion/completions/firn
  firn completions zsh > \"${fpath[1]}/_firn\"
  firn completions fish > ~/.config/fish/completions/firn.fish
  firn completions powershell >> $PROFILE";

/// Options of `firn completions`.
#[derive(Args, Clone, Debug)]
pub struct Options {
    /// The shell.
    shell: Shell,
}

/// Prints the script for a shell.
///
/// # Errors
/// Where standard output can't be written.
pub fn run(options: &Options) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(options.shell, &mut Cli::command(), "firn", &mut script);
    super::print(&script)
}
