//! `frhc check --eds`: findings in EDS files by line, and the nodes of a configuration whose EDS has errors.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::Context;
use serde::Serialize;

use crate::exit::{Failure, Kind, OrFail};
use crate::print;
use canopen::eds::{Eds, Finding, Severity};
use config::file_kind::FileKind;
use config::{Config, EdsFile, files};

/// EDS file with its findings.
#[derive(Serialize)]
struct Report {
    file: String,
    objects: usize,
    findings: Vec<Finding>,
}

/// Maximum number of gaps listed for a file.
const MAX_GAPS: usize = 3;

/// Returns one line for each gap in an EDS, one for each EDS with other errors, and one for each number of an identity that
/// its EDS contradicts. A file that several nodes share is named once.
pub(super) fn lines(config: &Config) -> Vec<String> {
    let mut lines = Vec::new();
    for EdsFile { path, eds, errors, gaps } in &config.eds_files {
        let path = path.display();
        let conflicts = eds.identity_conflicts().into_iter();
        lines.extend(conflicts.map(|conflict| format!("eds   {path}:{conflict}")));
        let shown = gaps.iter().take(MAX_GAPS);
        lines.extend(
            shown.map(|gap| format!("eds   {path}:{gap}; nothing that is used is missing")),
        );
        let left = errors.saturating_sub(gaps.len().min(MAX_GAPS));
        if left > 0 {
            lines.push(format!("eds   {path}: {}; see frhc check --eds", many(left, "error")));
        }
    }
    lines
}

/// Returns the nodes whose EDS has errors; the readable objects of such an EDS are used.
pub(super) fn faulty_json(config: &Config) -> serde_json::Value {
    let faulty = config.data_sheets().filter_map(|(node, eds)| {
        let file = config.eds_files.iter().find(|file| Arc::ptr_eq(&file.eds, eds))?;
        let errors = file.errors;
        (errors > 0).then(|| serde_json::json!({ "node": node, "errors": errors }))
    });
    faulty.collect()
}

/// Reads all files, then prints their findings.
pub(super) fn run(paths: &[PathBuf], json: bool) -> Result<(), Failure> {
    let reports = paths.iter().map(|file| read(file)).collect::<Result<Vec<_>, _>>()?;
    let (errors, warnings) = (count(&reports, Severity::Error), count(&reports, Severity::Warning));
    if json {
        let (ok, files) = (errors == 0, &reports);
        let report =
            serde_json::json!({ "ok": ok, "errors": errors, "warnings": warnings, "files": files });
        print::line(&report.to_string());
    } else {
        reports.iter().for_each(Report::print);
    }
    let negative = format!("{}, {}", many(errors, "error"), many(warnings, "warning"));
    if errors > 0 { Err(Failure::new(Kind::Negative, negative)) } else { Ok(()) }
}

fn read(file: &Path) -> Result<Report, Failure> {
    let named = || file.display().to_string();
    let bytes = files::read(file).with_context(named).or_fail(Kind::Configuration)?;
    let eds = match (Eds::parse(&bytes), str::from_utf8(&bytes).ok().and_then(FileKind::from_text))
    {
        (Err(_), Some(kind)) => {
            return Err(Failure::new(Kind::Configuration, format!("{}: is {kind}", named())));
        }
        (parsed, _) => parsed.with_context(named).or_fail(Kind::Configuration)?,
    };
    Ok(Report { file: named(), objects: eds.objects().len(), findings: eds.lint() })
}

impl Report {
    fn print(&self) {
        for finding in &self.findings {
            print::line(&format!("{}:{finding}", self.file));
        }
        if self.findings.is_empty() {
            print::line(&format!("{}: valid, {} objects", self.file, self.objects));
        }
    }
}

fn count(reports: &[Report], severity: Severity) -> usize {
    reports.iter().map(|report| number(&report.findings, severity)).sum()
}

fn number(findings: &[Finding], severity: Severity) -> usize {
    findings.iter().filter(|finding| finding.severity == severity).count()
}

fn many(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}
