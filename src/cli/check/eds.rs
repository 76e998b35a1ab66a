//! `frhc check --eds`: what is wrong with data sheets, line by line.

use std::path::Path;
use std::path::PathBuf;

use anyhow::Context;

use crate::canopen::eds::Eds;
use crate::canopen::eds::Finding;
use crate::canopen::eds::Severity;
use crate::cli::exit::Failure;
use crate::cli::exit::Kind;
use crate::cli::exit::OrFail;
use crate::cli::print;
use crate::config::files;

/// One file, and what is wrong with it.
struct Report<'a> {
    file: &'a Path,
    objects: usize,
    findings: Vec<Finding>,
}

/// Reads all files, then prints what is wrong with them.
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
            print::line(&format!("{}: in order, {} objects", self.file.display(), self.objects));
        }
    }
}

fn count(reports: &[Report<'_>], severity: Severity) -> usize {
    let findings = reports.iter().flat_map(|report| &report.findings);
    findings.filter(|finding| finding.severity == severity).count()
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
