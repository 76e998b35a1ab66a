//! Process of the node, which starts the far side, measures, and prints the row.

use std::io::{BufRead, BufReader, Lines, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Duration;

use contract::NodeEnd;
use units::time::Instant;

use crate::Outcome;
use crate::carrier;
use crate::end::{End, now};
use crate::figures::{Direction, Record, millis, quantiles, share, within};
use crate::options::Options;
use crate::role::Role;

/// Maximum time until the first fresh sample.
const START_LIMIT: Duration = Duration::from_secs(20);

/// Time from the first sample to the measurement; an operator needs longer to arm.
const SETTLING: Duration = Duration::from_millis(500);

/// Time allowed for the last messages to arrive.
const DRAIN: Duration = Duration::from_millis(600);

/// Process of the far side.
struct FarSide {
    child: Child,
    input: ChildStdin,
    lines: Lines<BufReader<ChildStdout>>,
}

impl FarSide {
    /// Starts the process; returns once it listens.
    fn start(options: &Options) -> Outcome<Self> {
        let mut child = Command::new(std::env::current_exe()?)
            .args(["far=true".to_owned(), format!("carrier={}", options.carrier.name())])
            .args([format!("rate={}", options.rate), format!("window={}", options.window)])
            .args([format!("folder={}", options.folder), format!("port={}", options.port)])
            .arg(format!("redeclare={}", options.redeclares))
            .arg(format!("open_timeout={}", options.open_timeout))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let input = child.stdin.take().ok_or("no standard input")?;
        let output = child.stdout.take().ok_or("no standard output")?;
        let mut far = Self { child, input, lines: BufReader::new(output).lines() };
        far.line()?;
        Ok(far)
    }

    fn line(&mut self) -> Outcome<String> {
        Ok(self.lines.next().ok_or("the far side ended")??)
    }

    /// Ends the process; returns its figures of messages sent in `from..to`.
    fn end(mut self, (from, to): (u64, u64)) -> Outcome<Direction> {
        writeln!(self.input, "{from} {to}")?;
        let figures = Direction::from_line(&self.line()?);
        self.child.kill()?;
        self.child.wait()?;
        figures
    }
}

/// Measures, and prints one row.
pub(crate) fn run(options: &Options) -> Outcome<()> {
    let folder = std::env::temp_dir().join(format!("carriers{}", std::process::id()));
    std::fs::create_dir_all(&folder)?;
    let row = measure(options, &folder);
    std::fs::remove_dir_all(&folder)?;
    let Options { label, carrier, rate, .. } = options;
    writeln!(std::io::stdout(), "| {label}{} | {rate} | {} |", carrier.name(), row?)?;
    Ok(())
}

fn measure(options: &Options, folder: &Path) -> Outcome<String> {
    carrier::make_certificates(folder)?;
    let folder = folder.to_string_lossy().into_owned();
    let options = Options { folder, ..options.clone() };
    let far = FarSide::start(&options)?;
    let start = now();
    let node = NodeEnd::new(0, start.as_micros());
    let mut end = End::open(&options, Role::Near(Box::new(node), None))?;
    let Some(first) = first_sample(&mut end, start)? else {
        let from = start.as_micros();
        let direction = far.end((from, now().as_micros()))?;
        return Ok(nothing(&end.record, &direction));
    };
    run_for(&mut end, SETTLING, true)?;
    end.arm();
    let from = now();
    run_for(&mut end, Duration::from_secs(u64::from(options.seconds)), true)?;
    let span = (from.as_micros(), now().as_micros());
    run_for(&mut end, DRAIN, false)?;
    let far = far.end(span)?;
    row(&options, &end.record, &far, span, first)
}

/// Returns the time until the first fresh sample.
fn first_sample(end: &mut End, start: Instant) -> Outcome<Option<Duration>> {
    loop {
        let age = end.cycle(true)?;
        let since = now().since(start);
        if age.is_some() {
            return Ok(Some(since));
        }
        if since > START_LIMIT {
            return Ok(None);
        }
    }
}

fn run_for(end: &mut End, span: Duration, sends: bool) -> Outcome<()> {
    let start = now();
    while now().since(start) < span {
        end.cycle(sends)?;
    }
    Ok(())
}

/// Returns the row of a link without any fresh sample.
fn nothing(near: &Record, far: &Direction) -> String {
    let (to_near, to_far) = (near.received.len(), far.ages.len());
    format!(
        "no sample in 20 s ({to_near} feedbacks, {to_far} commands received) | – | – | – | – | – | –"
    )
}

fn row(
    options: &Options,
    near: &Record,
    far: &Direction,
    span: (u64, u64),
    first: Duration,
) -> Outcome<String> {
    let own = Direction::from_record(near, span)?;
    let (sent, ages) = (own.sent + far.sent, [own.ages.as_slice(), &far.ages].concat());
    let received = u64::try_from(ages.len())?;
    let rate = sent / 2 / u64::from(options.seconds.max(1));
    let trips = trips(&within(&near.cycles, span.0, span.1), options.limit);
    let held = if far.is_held { ", held" } else { "" };
    let again = own.declared_again + far.declared_again;
    let again = if again > 0 { format!(" ({again} again)") } else { String::new() };
    Ok(format!(
        "{}{again} | {rate} | {} | {} | {} | {} | {trips}{held}",
        millis(u64::try_from(first.as_micros())?),
        share(received, sent),
        quantiles(ages),
        quantiles(within(&near.round_trips, span.0, span.1)),
        millis(own.longest_put.max(far.longest_put)),
    ))
}

/// Returns the number of times that the newest sample's age exceeded the limit.
fn trips(ages: &[u64], limit: Duration) -> usize {
    let is_over = |age: &u64| Duration::from_micros(*age) > limit;
    let first = usize::from(ages.first().is_some_and(is_over));
    first + ages.iter().zip(ages.iter().skip(1)).filter(|(a, b)| !is_over(a) && is_over(b)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trips_count_each_rise_above_the_limit() {
        let limit = Duration::from_micros(10);
        assert_eq!(trips(&[11, 12, 9, 10, 11, 3, 20], limit), 3);
        assert_eq!(trips(&[], limit), 0);
    }
}
