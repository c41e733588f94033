//! `trace.json`: read back, its events nest, and the device's are those of `stats.jsonl`.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::suite::support::{Folder, assert_success, json, run_into, stats};

struct Event {
    name: String,
    thread: u64,
    frame: u64,
    begin_us: f64,
    end_us: f64,
}

/// The device's thread.
const DEVICE: u64 = 2;

/// Two times of one clock are alike within rounding to f64 of microseconds since the beginning, under an hour: 2^-20 us.
const ROUNDING_US: f64 = 1e-6;

impl Event {
    fn of(event: &Value) -> Self {
        let begin_us = event["ts"].as_f64().unwrap();
        let duration_us = event["dur"].as_f64().unwrap();
        assert!(begin_us >= 0.0 && duration_us >= 0.0, "{event}");
        Self {
            name: event["name"].as_str().unwrap().to_owned(),
            thread: event["tid"].as_u64().unwrap(),
            frame: event["args"]["frame"].as_u64().unwrap(),
            begin_us,
            end_us: begin_us + duration_us,
        }
    }

    fn ms(&self) -> f64 {
        (self.end_us - self.begin_us) / 1e3
    }

    fn holds(&self, other: &Self) -> bool {
        self.begin_us <= other.begin_us + ROUNDING_US && other.end_us <= self.end_us + ROUNDING_US
    }

    fn is_apart_from(&self, other: &Self) -> bool {
        self.end_us <= other.begin_us + ROUNDING_US || other.end_us <= self.begin_us + ROUNDING_US
    }
}

/// On each thread two events are apart, or one holds the other.
fn assert_nested(spans: &[Event]) {
    for (at, one) in spans.iter().enumerate() {
        for other in spans[..at]
            .iter()
            .filter(|other| other.thread == one.thread)
        {
            let is_nested = one.holds(other) || other.holds(one);
            let is_fine = one.is_apart_from(other) || is_nested;
            assert!(is_fine, "{} and {} overlap", one.name, other.name);
        }
    }
}

#[test]
fn frames_in_flight_overlap_on_threads_of_their_own() {
    let folder = Folder::new("chrome-trace-in-flight");
    let out = folder.join("out");
    let command = "run --session simulated --frames 8 --size 48x48 --photons 5000 --set photon.every_frame=true \
                   --set output.images=false --set output.chrome_trace=true --set gpu.frames_in_flight=2";
    assert_success(&run_into(&out, command, &[]));
    let events = json(&out.join("trace.json"));
    let events = events.as_array().unwrap();
    let spans = events.iter().filter(|event| event["ph"] == "X");
    let spans: Vec<Event> = spans.map(Event::of).collect();
    assert_nested(&spans);
    // The host begins a frame while the device still computes the one before; where each is waited for it never does.
    let overlaps = |frame: u64| {
        let is_turn = |event: &&Event| event.name == "frame" && event.frame == frame;
        let turn = spans.iter().find(is_turn).unwrap();
        let passes = spans.iter().filter(|event| event.thread == DEVICE);
        let before = passes.filter(|event| event.frame == frame - 1);
        before
            .map(|event| event.end_us)
            .any(|end_us| turn.begin_us < end_us)
    };
    assert!((1..8).any(overlaps), "no frame overlapped");
    let stats = stats(&out);
    assert_eq!(stats.len(), 8);
    for (index, line) in stats.iter().enumerate() {
        assert_eq!(line["frame"].as_u64(), Some(index as u64));
        assert_eq!(line["photons"]["traced"], true);
        if index > 0 {
            assert_eq!(line["host_waits"], 0, "frame {index}");
        }
    }
}

#[test]
fn a_trace_holds_stages_and_passes_on_one_clock() {
    let folder = Folder::new("chrome-trace");
    let out = folder.join("out");
    let command = "run --session simulated --frames 3 --size 16x12 --photons 500 --set output.chrome_trace=true";
    assert_success(&run_into(&out, command, &[]));
    let events = json(&out.join("trace.json"));
    let events = events.as_array().unwrap();
    let (names, spans): (Vec<_>, Vec<_>) = events.iter().partition(|event| event["ph"] == "M");
    assert_eq!(names.len(), 3, "a process and two threads have names");
    assert!(spans.iter().all(|event| event["ph"] == "X"));
    let thread = |wanted: &str| {
        let named = names.iter().find(|event| event["args"]["name"] == wanted);
        named.unwrap()["tid"].as_u64().unwrap()
    };
    let run = json(&out.join("run.json"));
    let host = thread("host");
    let device = thread(run["adapter"]["name"].as_str().unwrap());
    let spans: Vec<Event> = spans.into_iter().map(Event::of).collect();

    assert_nested(&spans);
    let stats = stats(&out);
    assert_eq!(stats.len(), 3);
    for stats in &stats {
        let of_frame = |thread| {
            let number = stats["frame"].as_u64();
            let is_there =
                move |event: &&Event| event.thread == thread && Some(event.frame) == number;
            spans.iter().filter(is_there)
        };
        let frame = of_frame(host).find(|event| event.name == "frame").unwrap();
        for stage in ["wait", "session", "update", "render", "read_back", "write"] {
            let of_stage = of_frame(host).filter(|event| event.name == stage);
            let sum_ms: f64 = of_stage.map(Event::ms).sum();
            let wanted = stats["cpu_ms"][stage].as_f64().unwrap();
            let off = (sum_ms - wanted).abs();
            assert!(off < 1e-6, "{stage}: {sum_ms} and {wanted}");
        }
        let mut pass_ms: BTreeMap<String, f64> = BTreeMap::new();
        for event in of_frame(device) {
            assert!(frame.holds(event), "{} lies outside its frame", event.name);
            let submissions = of_frame(host).filter(|host| host.name.starts_with("submission"));
            let holders = submissions.filter(|host| host.holds(event)).count();
            assert_eq!(holders, 1, "{}", event.name);
            *pass_ms.entry(event.name.clone()).or_default() += event.ms();
        }
        assert!(of_frame(host).all(|event| frame.holds(event)));
        let wanted = stats["pass_ms"].as_object().unwrap();
        assert!(!wanted.is_empty());
        let are_same = pass_ms.keys().eq(wanted.keys());
        assert!(are_same, "{pass_ms:?} and {wanted:?}");
        for (name, ms) in &pass_ms {
            // Ticks are whole: only differences of microseconds are rounded.
            let wanted = wanted[name].as_f64().unwrap();
            assert!((ms - wanted).abs() < 1e-6, "{name}: {ms} and {wanted}");
        }
    }
}
