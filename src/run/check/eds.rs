//! `frhc check --eds`: findings in EDS files by line, and the nodes of a configuration whose EDS has errors.

use std::fmt;
use std::path::{Path, PathBuf};

use anyhow::Context;

use crate::exit::{Failure, Kind, OrFail};
use crate::print;
use canopen::eds::{Eds, Finding, Severity};
use config::{Config, files};

/// A file and its findings.
struct Report<'a> {
    file: &'a Path,
    objects: usize,
    findings: Vec<Finding>,
}

/// A node whose EDS has errors; its readable objects are used.
pub(super) struct FaultyEds<'a> {
    node: &'a str,
    errors: usize,
}

/// Formats as `eds   elbow            2 errors; see frhc check --eds`.
impl fmt::Display for FaultyEds<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let errors = many(self.errors, "error");
        write!(f, "eds   {:16} {errors}; see frhc check --eds", self.node)
    }
}

/// Returns the nodes of a configuration whose EDS has errors.
pub(super) fn faulty(config: &Config) -> Vec<FaultyEds<'_>> {
    let faulty = config
        .data_sheets()
        .map(|(node, eds)| FaultyEds { node, errors: number(&eds.lint(), Severity::Error) });
    faulty.filter(|eds_of_node| eds_of_node.errors > 0).collect()
}

/// Returns the nodes of [`faulty`] as JSON.
pub(super) fn faulty_json(config: &Config) -> serde_json::Value {
    let one = |eds_of_node: &FaultyEds<'_>| serde_json::json!({ "node": eds_of_node.node, "errors": eds_of_node.errors });
    faulty(config).iter().map(one).collect()
}

/// Reads all files, then prints their findings.
pub(super) fn run(paths: &[PathBuf], json: bool) -> Result<(), Failure> {
    let reports = paths.iter().map(|file| read(file)).collect::<Result<Vec<_>, _>>()?;
    let (errors, warnings) = (count(&reports, Severity::Error), count(&reports, Severity::Warning));
    if json {
        print::line(&as_json(&reports, errors, warnings).to_string());
    } else {
        reports.iter().for_each(Report::print);
    }
    let negative = format!("{}, {}", many(errors, "error"), many(warnings, "warning"));
    if errors > 0 { Err(Failure::new(Kind::Negative, negative)) } else { Ok(()) }
}

fn read(file: &Path) -> Result<Report<'_>, Failure> {
    let named = || file.display().to_string();
    let bytes = files::read(file).with_context(named).or_fail(Kind::Configuration)?;
    let eds = Eds::parse(&bytes).with_context(named).or_fail(Kind::Configuration)?;
    Ok(Report { file, objects: eds.objects().len(), findings: eds.lint() })
}

impl Report<'_> {
    fn print(&self) {
        for finding in &self.findings {
            print::line(&format!("{}:{finding}", self.file.display()));
        }
        if self.findings.is_empty() {
            print::line(&format!("{}: valid, {} objects", self.file.display(), self.objects));
        }
    }
}

fn count(reports: &[Report<'_>], severity: Severity) -> usize {
    reports.iter().map(|report| number(&report.findings, severity)).sum()
}

fn number(findings: &[Finding], severity: Severity) -> usize {
    findings.iter().filter(|finding| finding.severity == severity).count()
}

fn many(count: usize, what: &str) -> String {
    if count == 1 { format!("1 {what}") } else { format!("{count} {what}s") }
}

fn as_json(reports: &[Report<'_>], errors: usize, warnings: usize) -> serde_json::Value {
    let files = reports.iter().map(|report| {
        let findings = report.findings.iter().map(|finding| {
            serde_json::json!({
                "line": finding.line,
                "severity": finding.severity.to_string(),
                "place": finding.place,
                "key": finding.key,
                "reason": finding.reason,
            })
        });
        serde_json::json!({
            "file": report.file.display().to_string(),
            "objects": report.objects,
            "findings": findings.collect::<Vec<_>>(),
        })
    });
    serde_json::json!({
        "ok": errors == 0,
        "errors": errors,
        "warnings": warnings,
        "files": files.collect::<Vec<_>>(),
    })
}
