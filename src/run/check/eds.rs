//! `frhc check --eds`: what is wrong with data sheets, line by line; and which of a configuration's
//! have anything wrong.

use std::fmt;
use std::path::Path;
use std::path::PathBuf;

use anyhow::Context;

use crate::exit::Failure;
use crate::exit::Kind;
use crate::exit::OrFail;
use crate::print;
use canopen::eds::Eds;
use canopen::eds::Finding;
use canopen::eds::Severity;
use config::Config;
use config::files;

/// One file, and what is wrong with it.
struct Report<'a> {
    file: &'a Path,
    objects: usize,
    findings: Vec<Finding>,
}

/// A node whose EDS has errors: it was read as well as could be.
pub(super) struct Doubt<'a> {
    node: &'a str,
    errors: usize,
}

/// `eds   elbow            2 errors; see frhc check --eds`.
impl fmt::Display for Doubt<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let errors = many(self.errors, "error");
        write!(f, "eds   {:16} {errors}; see frhc check --eds", self.node)
    }
}

/// The nodes of a configuration whose EDS have errors.
pub(super) fn doubts(config: &Config) -> Vec<Doubt<'_>> {
    let joints = config.joints.iter().map(|joint| (joint.name.as_str(), &joint.eds));
    let nodes = joints.chain([("switch box", &config.switches.eds)]);
    let doubts =
        nodes.map(|(node, eds)| Doubt { node, errors: number(&eds.lint(), Severity::Error) });
    doubts.filter(|doubt| doubt.errors > 0).collect()
}

/// The same as data.
pub(super) fn doubts_json(config: &Config) -> serde_json::Value {
    let one = |doubt: &Doubt<'_>| serde_json::json!({ "node": doubt.node, "errors": doubt.errors });
    doubts(config).iter().map(one).collect()
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
