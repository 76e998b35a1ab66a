//! Decodes a candump log by joint in SI units: a file, or the transcript of a boot from the tests.
//!
//! `cargo run --release --example decode_a_log [LOG [CONFIG]]`
#![allow(clippy::print_stdout, reason = "an example prints")]

use std::error::Error;
use std::path::Path;
use std::time::Duration;
use std::{env, fs};

use canopen::frame::Channel;
use canopen_tools::candump::{Content, Line};
use canopen_tools::decode::Decoder;
use canopen_tools::members;
use config::Config;
use units::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = env::args().skip(1);
    let log = words.next().unwrap_or_else(|| "tests/golden/boot.log".to_owned());
    let config = words.next().unwrap_or_else(|| "config/kraft_like_500hz.toml".to_owned());
    let config = Config::load(Path::new(&config))?;

    let mut decoder = Decoder::new(members::members(&config), members::timing(&config));
    let bus = decoder.listen(Some(Channel(0)));
    for text in fs::read_to_string(log)?.lines() {
        let Ok(line) = Line::parse(text) else { continue };
        let (Content::Data(data), Ok(cob_id)) = (line.content, u16::try_from(line.id)) else {
            continue;
        };
        let at = Instant::ZERO + Duration::from_nanos(line.nanos);
        println!("{text}    {}", decoder.on_frame(bus, Some(at), cob_id, &data));
    }
    Ok(())
}
