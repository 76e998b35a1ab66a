//! Parts of the session: host, files with their checksums, missing parts, result of the replay.

use crate::html::{Cell, Html};
use crate::replayed;
use crate::view::View;
use crate::words::counted;
use signals::ReplayVerdict;

/// Writes the parts.
pub(crate) fn write(html: &mut Html, view: &View<'_>) {
    html.section("parts", "Files and replay");
    let is_equal = view.gathered.findings.verdict == Some(ReplayVerdict::Equal);
    let found = replayed::sentence(&view.gathered.findings);
    if is_equal {
        html.paragraph(&found);
    } else {
        html.missing(&found);
    }
    let remarks = view.subject.remarks.iter().chain(&view.gathered.findings.remarks);
    let mut is_whole = is_equal;
    for remark in remarks {
        is_whole = false;
        html.missing(&format!("Missing: {remark}."));
    }
    if is_whole {
        html.paragraph("No part of it is missing.");
    }
    let Some(manifest) = &view.subject.manifest else {
        html.missing("Without session.json, host, program and files are not known.");
        html.end_section();
        return;
    };
    let host = &manifest.host;
    html.definitions(&[
        ("Host", host.name.clone().unwrap_or_else(|| "left out".to_owned())),
        ("Processor", host.processor.clone()),
        ("Processors", host.processors.to_string()),
        ("Kernel", format!("{} {}", host.kernel, host.machine)),
        ("Program", manifest.program.clone()),
        ("Format of the session", manifest.format.to_string()),
        ("Interfaces", manifest.interfaces.join(", ")),
    ]);
    let rows: Vec<Vec<Cell>> = manifest
        .files
        .iter()
        .map(|file| {
            vec![
                Cell::Code(file.path.clone()),
                Cell::Code(file.copy.clone()),
                Cell::Code(file.sha256.clone()),
            ]
        })
        .collect();
    let number = u64::try_from(rows.len()).unwrap_or(0);
    html.table(
        &format!("{} that the session has copied", counted(number, "file")),
        &["Path", "Copy", "SHA-256"],
        &rows,
    );
    html.end_section();
}
