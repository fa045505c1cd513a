//! The `--report` option of commands on an existing report.

use std::path::PathBuf;

/// Which report a command is about.
#[derive(clap::Args)]
pub struct ReportFolder {
    /// The report's folder
    #[arg(
        id = "report",
        long = "report",
        alias = "output",
        short_alias = 'o',
        value_name = "DIR",
        default_value = "umbra-report"
    )]
    pub path: PathBuf,
}
