//! `firn serve --print-config`: every option as it would hold, with its origin.

use std::fmt::Write;

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, CommandFactory};

use super::{Cli, Failure};

/// What stands for a secret.
const SECRET: &str = "(secret)";

/// Where a value can come from, the strongest first, and what stands above those values.
const ORIGINS: [(Option<ValueSource>, &str); 4] = [
    (Some(ValueSource::CommandLine), "From the command line:"),
    (Some(ValueSource::EnvVariable), "From the environment:"),
    (Some(ValueSource::DefaultValue), "Defaults:"),
    (None, "Not set:"),
];

/// Prints the options of `firn serve` as the environment variables that say the same, so that they
/// can be read by Docker or systemd; secrets are left out.
///
/// # Errors
/// Where standard output can't be written.
pub fn run(given: &ArgMatches) -> Result<(), Failure> {
    let (_, given) = given.subcommand().expect("`firn serve` was asked for");
    super::print(describe(given).as_bytes())
}

fn describe(given: &ArgMatches) -> String {
    let program = Cli::command();
    let serve = program.find_subcommand("serve").expect("there is `firn serve`");
    let mut text = String::new();
    for (origin, title) in ORIGINS {
        let lines = serve
            .get_arguments()
            .filter(|option| option.get_env().is_some())
            .filter(|option| given.value_source(option.get_id().as_str()) == origin)
            .map(|option| line(option, given));
        let lines: String = lines.collect();
        if !lines.is_empty() {
            let gap = if text.is_empty() { "" } else { "\n" };
            // Writing to a string does not fail.
            let _ = write!(text, "{gap}# {title}\n{lines}");
        }
    }
    text
}

/// `NAME=value`; a comment where there is no value, or it is secret.
fn line(option: &Arg, given: &ArgMatches) -> String {
    let name = option.get_env().map(|name| name.to_string_lossy()).unwrap_or_default();
    let values = given.get_raw(option.get_id().as_str()).map(|values| {
        let texts: Vec<_> = values.map(|value| value.to_string_lossy()).collect();
        texts.join(",")
    });
    match values {
        None => format!("# {name}=\n"),
        Some(_) if option.is_hide_env_values_set() => format!("# {name}={SECRET}\n"),
        Some(value) => format!("{name}={value}\n"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_told_with_their_origin_and_without_secrets() {
        let line = "firn serve --listen 127.0.0.1:9 --api-key 0123456789abcdef --demo \
                    --allowed-host a --allowed-host b,c";
        let given = Cli::command().get_matches_from(line.split_whitespace());
        let text = describe(given.subcommand_matches("serve").unwrap());
        let (from_line, others) = text.split_once("\n\n").unwrap();
        let expected = "# From the command line:\nFIRN_LISTEN=127.0.0.1:9\n\
                        # FIRN_API_KEY=(secret)\nFIRN_ALLOWED_HOST=a,b,c\nFIRN_DEMO=true";
        assert_eq!(from_line, expected);
        assert!(others.contains("# Defaults:\n") && others.contains("\nFIRN_ALLOW_OPEN=false\n"));
        assert!(others.contains("# Not set:\n") && others.contains("\n# FIRN_TLS_KEY=\n"));
        assert!(!text.contains("0123456789abcdef"));
    }
}
