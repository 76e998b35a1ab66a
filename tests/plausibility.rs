//! probe
#![allow(
    clippy::unwrap_used,
    clippy::indexing_slicing,
    clippy::float_cmp,
    clippy::panic,
    reason = "test"
)]
mod common;
use common::bench::config;
use common::bench::scenario;
use frhc::canopen::object::Object;
use frhc::lab::bench::Bench;

#[test]
#[ignore]
fn probe() {
    for name in
        std::env::var("CFG").unwrap_or("kraft_like,jpl_like,kraft_like_500hz".to_owned()).split(',')
    {
        let cfg = config(&format!("config/{name}.toml"));
        for sc in std::env::var("SC")
            .unwrap_or("contact_10s,relaxed_10s,free,stiff-wall,teleoperation".to_owned())
            .split(',')
        {
            let script = scenario(sc);
            let t = std::env::var("SEC").map_or(script.seconds(), |s| s.parse().unwrap());
            let cycles = (t / cfg.period.as_secs_f64()) as u64;
            let mut bench = Bench::new(&cfg, script, 1, false, ());
            bench.bring_up().unwrap();
            let mut last: Option<frhc::telemetry::record::Record> = None;
            let (mut qd, mut v, mut out, mut cause) = ([0.0_f64; 6], 0.0_f64, [f64::MIN; 6], None);
            let mut told = [0_i16; 6];
            let mut off = [0_i32; 6];
            let mut hist = [[0_i16; 6]; 5];
            for n in 0..cycles {
                let r = bench.cycle();
                if let Some(last) = &last {
                    if r.sampled == [true; 6] && last.sampled == [true; 6] {
                        let dt = r.at.since(last.at).as_secs_f64();
                        for j in 0..6 {
                            qd[j] = qd[j].max(((r.output.q[j] - last.output.q[j]) / dt).abs());
                        }
                        v = v.max(
                            (r.output.x_0_g.translation.vector
                                - last.output.x_0_g.translation.vector)
                                .norm()
                                / dt,
                        );
                    }
                }
                for j in 0..6 {
                    let [lo, hi] = cfg.joints[j].link.range;
                    out[j] = out[j].max((lo - r.output.q[j]).max(r.output.q[j] - hi));
                    told[j] = told[j].max(r.targets[j].abs());
                    let drive = bench.world_mut().drive_mut(j + 1).unwrap();
                    let a = drive.dictionary().get(Object::TORQUE_ACTUAL).unwrap();
                    let a = i32::from(i16::from_le_bytes(a.try_into().unwrap()));
                    let h = || hist.iter().map(|h| i32::from(h[j]));
                    off[j] = off[j].max(a - h().max().unwrap()).max(h().min().unwrap() - a);
                }
                hist.rotate_right(1);
                hist[0] = r.targets;
                if cause.is_none() && r.cause.is_some() {
                    cause = r.cause.map(|c| (n, c.to_string()));
                }
                last = Some(r);
            }
            println!(
                "{name} {sc}: qd {qd:.2?} v {v:.2} out {out:.3?} told {told:?} off {off:?} cause {cause:?}"
            );
        }
    }
}

#[test]
#[ignore]
fn probe_faults() {
    let name = std::env::var("CFG").unwrap_or("kraft_like".to_owned());
    let cfg = config(&format!("config/{name}.toml"));
    for sc in std::env::var("SC").unwrap().split(',') {
        let script = scenario(&format!("faults/{sc}"));
        let cycles = (script.seconds() / cfg.period.as_secs_f64()) as u64;
        let fault = script.faults()[0].begins;
        let mut bench = Bench::new(&cfg, script, 1, false, ());
        bench.bring_up().unwrap();
        let begun = bench.node().bus().stations().begun().unwrap();
        let mut seen = None;
        let (mut missed, mut told) = ([0; 6], [[i16::MAX; 6], [i16::MIN; 6]]);
        let mut q = ([f64::MAX; 6], [f64::MIN; 6]);
        for _ in 0..cycles {
            let r = bench.cycle();
            let at = r.at.since(begun).as_secs_f64() - fault.as_secs_f64();
            if at > 0.0 && seen.is_none() {
                for j in 0..6 {
                    missed[j] += u32::from(!r.sampled[j]);
                    told[0][j] = told[0][j].min(r.targets[j]);
                    told[1][j] = told[1][j].max(r.targets[j]);
                    q.0[j] = q.0[j].min(r.output.q[j]);
                    q.1[j] = q.1[j].max(r.output.q[j]);
                }
            }
            if r.cause != seen {
                println!("{name} {sc}: {at:.4} s {:?} {}", r.mode, r.cause.unwrap());
                seen = r.cause;
            }
        }
        println!("{name} {sc}: missed {missed:?} told {told:?} q {:.3?} .. {:.3?}", q.0, q.1);
    }
}
