//! `firn configuration`: the options of `firn serve` as the table in `docs/operations.md`.

use clap::{Arg, CommandFactory};

use super::{Cli, Failure};

/// A Markdown table of the options of `firn serve`: flag, environment variable, default, meaning.
pub fn table() -> String {
    let program = Cli::command();
    let serve = program.find_subcommand("serve").expect("there is `firn serve`");
    let rows = serve.get_arguments().filter(|option| option.get_env().is_some()).map(row);
    let head = "| option | environment | default | meaning |\n|---|---|---|---|\n";
    head.to_owned() + &rows.collect::<String>()
}

/// Prints the table.
pub fn run() -> Result<(), Failure> {
    super::print(table().as_bytes())
}

fn row(option: &Arg) -> String {
    let takes_value = option.get_action().takes_values();
    let mut flag = format!("--{}", option.get_long().expect("every option has a long name"));
    if let Some([name, ..]) = option.get_value_names().filter(|_| takes_value) {
        flag += &format!(" {name}");
    }
    let variable = option.get_env().map(|name| code(&name.to_string_lossy())).unwrap_or_default();
    let values: Vec<_> = option.get_default_values().iter().map(|v| v.to_string_lossy()).collect();
    let default = match values.as_slice() {
        _ if !takes_value => "off".to_owned(),
        [] => String::new(),
        values => code(&values.join(",")),
    };
    let mut meaning = option.get_help().map(ToString::to_string).unwrap_or_default();
    for value in option.get_possible_values().iter().filter(|_| takes_value) {
        let help = value.get_help().map(ToString::to_string).unwrap_or_default();
        meaning += &format!("; {}: {help}", code(value.get_name()));
    }
    format!("| {} | {variable} | {default} | {} |\n", code(&flag), meaning.replace('|', "\\|"))
}

fn code(text: &str) -> String {
    format!("`{text}`")
}
