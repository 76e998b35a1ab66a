//! `frhc plot`: signals of a session over time, as a picture or a table.

use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};

use clap::Args;

use crate::export::csv::{Table, remarks};
use crate::session_config::configuration;
use crate::session_progress;
use crate::span::{Span, seconds};
use crate::whole_file::WholeFile;
use ::replay::Session;
use node::record::Mode;
use picture::strip::{Band, Curve, Event, Extent, Plot as Chart, Strip};
use run::exit::{Failure, Kind, OrFail};
use run::print;
use run::results::Force;
use signals::{Cycle, Envelope, Recording, Signal, catalogue, chosen};

/// Number of buckets of a curve: about two for each pixel.
const BUCKETS: usize = 2_000;

/// Width of a picture, in px.
const WIDTH: f64 = 1_000.0;

/// `frhc plot`.
#[derive(Debug, Args)]
pub struct Plot {
    /// Folder of the session.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// Signals: names, quantities such as `tau`, or patterns such as `*.elbow`.
    #[arg(value_name = "SIGNAL", required = true)]
    signals: Vec<String>,
    #[command(flatten)]
    span: Span,
    /// File to write, by its extension a picture (`.svg`; `.png` where the build has it) or a table (`.csv`) [default: SVG on stdout].
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

/// Form of the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Svg,
    #[cfg(feature = "png")]
    Png,
    Csv,
}

impl Form {
    fn from_extension(out: Option<&Path>) -> Result<Self, Failure> {
        let Some(path) = out else {
            let reason = "a picture is not for a terminal: give -o FILE.svg, .png or .csv";
            let is_terminal = io::stdout().is_terminal();
            return if is_terminal {
                Err(Failure::new(Kind::Usage, reason))
            } else {
                Ok(Self::Svg)
            };
        };
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("svg") => Ok(Self::Svg),
            #[cfg(feature = "png")]
            Some("png") => Ok(Self::Png),
            #[cfg(not(feature = "png"))]
            Some("png") => {
                let path = path.display();
                let reason = format!(
                    "--out {path}: this build draws no PNG; give FILE.svg, or build with --features png"
                );
                Err(Failure::new(Kind::Usage, reason))
            }
            Some("csv") => Ok(Self::Csv),
            Some(_) | None => {
                let path = path.display();
                let reason = format!("--out {path}: the name must end with .svg, .png or .csv");
                Err(Failure::new(Kind::Usage, reason))
            }
        }
    }
}

/// Draws the signals, or writes them as a table.
pub(super) fn run(args: &Plot, is_quiet: bool) -> Result<(), Failure> {
    let form = Form::from_extension(args.out.as_deref())?;
    let session = Session::open(&args.session).or_fail(Kind::File)?;
    let config = configuration(&session)?;
    let recording = Recording::new(&session, &config);
    let signals = chosen(&catalogue(&recording), &args.signals).or_fail(Kind::Usage)?;
    let mut cycles = recording.cycles().or_fail(Kind::File)?;
    let mut file = WholeFile::create(args.out.as_deref(), args.force)?;
    let progress = session_progress::start(&args.session, None, is_quiet)?;
    if form == Form::Csv {
        let table = Table { signals: &signals, span: args.span, every: 1 };
        return table.write(file, cycles, &progress);
    }
    let mut curves = Curves::new(signals);
    while let Some(cycle) = cycles.next() {
        if args.span.is_behind(&cycle) || progress.is_interrupted() {
            break;
        }
        progress.advance(1);
        if !args.span.is_before(&cycle) {
            curves.add(&cycle);
        }
    }
    progress.finish();
    if progress.is_interrupted() {
        return Err(Failure::new(Kind::Interrupted, "interrupted: no picture was written"));
    }
    let manifest = session.manifest();
    let title = format!("{}: {}", args.session.display(), manifest.configuration);
    let Some(strip) = curves.strip(title) else {
        return Err(Failure::new(Kind::Usage, "no cycle of the session is in this part"));
    };
    let svg = picture::standalone(&strip.svg(WIDTH));
    let content = match form {
        #[cfg(feature = "png")]
        Form::Png => picture::png(&svg).or_fail(Kind::File)?,
        Form::Svg | Form::Csv => svg.into_bytes(),
    };
    match file.write_all(&content) {
        Err(error) => return file.abandon(error),
        Ok(()) => file.finish()?,
    }
    remarks(cycles.findings()).iter().for_each(|remark| print::note(remark));
    Ok(())
}

/// Envelopes of signals, with the modes and stops of their time.
struct Curves {
    curves: Vec<(Signal, Envelope)>,
    bands: Vec<Band>,
    events: Vec<Event>,
    mode: Option<Mode>,
    time: Option<[f64; 2]>,
}

impl Curves {
    fn new(signals: Vec<Signal>) -> Self {
        let curves = signals.into_iter().map(|signal| (signal, Envelope::new(BUCKETS)));
        let (bands, events) = (Vec::new(), Vec::new());
        Self { curves: curves.collect(), bands, events, mode: None, time: None }
    }

    fn add(&mut self, cycle: &Cycle<'_>) {
        let at = seconds(cycle);
        for (signal, envelope) in &mut self.curves {
            envelope.add(at, signal.value(cycle));
        }
        self.time = Some([self.time.map_or(at, |[from, _]| from), at]);
        if let Some(band) = self.bands.last_mut() {
            band.to = at;
        }
        let before = self.mode.replace(cycle.mode);
        if before != Some(cycle.mode) {
            let colour = cycle.mode.code().into();
            let name = cycle.mode.name().to_owned();
            self.bands.push(Band { from: at, to: at, name, colour });
            if let Some(cause) = cycle.cause().filter(|_| before.is_some()) {
                self.events.push(Event { at, name: cause.to_string() });
            }
        }
    }

    /// Returns the picture; `None` without a cycle. A quantity has a plot for each of its units.
    fn strip(self, title: String) -> Option<Strip> {
        let [from, to] = self.time?;
        let mut strip = Strip::new(title, from..to.max(from + 1e-3));
        strip.bands = self.bands;
        strip.events = self.events;
        let mut plots: Vec<(&Signal, Vec<Curve>)> = Vec::new();
        for (signal, envelope) in &self.curves {
            let curve = Curve::new(signal.name.clone(), envelope.spans().into_iter().map(extent));
            let is_its =
                |one: &Signal| (one.quantity(), one.unit) == (signal.quantity(), signal.unit);
            match plots.iter_mut().find(|(one, _)| is_its(one)) {
                Some((_, curves)) => curves.push(curve),
                None => plots.push((signal, vec![curve])),
            }
        }
        let plots = plots.into_iter();
        strip.plots = plots
            .map(|(one, curves)| Chart::new(title_of(one, &curves), one.unit, curves))
            .collect();
        Some(strip)
    }
}

/// Returns the title of a plot: the name of its signal or quantity, its frame, and what it is.
fn title_of(signal: &Signal, curves: &[Curve]) -> String {
    let name = if curves.len() == 1 { &*signal.name } else { signal.quantity() };
    let frame =
        if signal.frame.is_empty() { String::new() } else { format!(" at {}", signal.frame) };
    format!("{name}{frame}: {}", signal.about)
}

/// Returns a span of an envelope as a picture takes it.
const fn extent(signals::Span { from, to, min, max }: signals::Span) -> Extent {
    Extent { from, to, min, max }
}
