//! Bad and odd input at every door, through the real command: scans, motions and bodies, brought in, looked at, trained on
//! and animated. Every run has 1.5 GiB of address space and five seconds of processor time; a refusal is one sentence that
//! names file and place, ends with the code of bad input, and leaves nothing behind. What is odd but tells what it means
//! comes in, and what was guessed is said.
//!
//! The cases go by number, 1 to 49: meshes 1 to 27, sequences 28 to 38, arrays and containers 39 to 49.

mod arrays;
mod files;
mod meshes;
mod sequences;

use crate::support::{Said, command, data_dir, folder, tiny_run};
use files::{Lay, fixture};
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Where a case is tried.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Door {
    /// `import scans` and `inspect`; the first refusal of a number at `train --data` too.
    Scans,
    /// `import motion` and `inspect`; the first refusal of a number at `animate` too.
    Motion,
    /// `import body` and `inspect`.
    Body,
}

/// What must come of a case.
enum Then {
    /// Refused, in a sentence with these words.
    Refused(Vec<&'static str>),
    /// Taken, with these words said; `check` looks at what was written.
    Fine(Vec<&'static str>, fn(&Path)),
}

/// One file, or a folder of files, at a door.
struct Case {
    number: u8,
    door: Door,
    /// What is given to the command, below the folder of the case.
    source: String,
    /// What lies in that folder.
    lay: Vec<Lay>,
    arguments: Vec<&'static str>,
    /// The file that a refusal names, where it is not the source.
    names: Option<&'static str>,
    then: Then,
}

impl Case {
    fn new(number: u8, door: Door, source: &str, lay: Vec<Lay>, then: Then) -> Self {
        Self { number, door, source: source.into(), lay, arguments: vec![], names: None, then }
    }

    /// A single file that is refused.
    fn refused(number: u8, door: Door, name: &str, bytes: impl Into<Vec<u8>>, words: &[&'static str]) -> Self {
        Self::new(number, door, name, vec![Lay::Bytes(name.into(), bytes.into())], Then::Refused(words.to_vec()))
    }

    /// A fixture under a name that is refused.
    fn fixture(number: u8, door: Door, file: &str, name: &str, words: &[&'static str]) -> Self {
        Self::refused(number, door, name, std::fs::read(fixture(file)).expect("a fixture"), words)
    }

    fn with(mut self, arguments: &[&'static str]) -> Self {
        self.arguments = arguments.to_vec();
        self
    }

    /// Runs the case at its doors. `first` is the first refusal of its number.
    fn run(&self, home: &Path, first: bool) {
        let home = home.join(format!("{:02}-{}", self.number, self.source));
        assert!(!home.exists(), "two cases of one name: {}", home.display());
        std::fs::create_dir_all(&home).expect("a folder");
        self.lay.iter().for_each(|lay| lay.down(&home));
        let (source, out) = (home.join(&self.source), home.with_added_extension("out"));
        let [from, to, data] = [&source, &out, &data_dir()].map(|p| p.display().to_string());
        let import: Vec<&str> = match self.door {
            Door::Scans => vec!["import", "scans", &from, "--out", &to, "--data-dir", &data],
            Door::Motion => vec!["import", "motion", &from, "--out", &to, "--data-dir", &data],
            Door::Body => vec!["import", "body", &from, "--out", &to],
        };
        let said = limited(&[&import[..], &self.arguments].concat());
        match &self.then {
            Then::Refused(words) => {
                self.told(&said, words);
                assert!(!out.exists(), "case {}: {} is left behind", self.number, out.display());
                if first {
                    self.elsewhere(&from, &to, words);
                }
            }
            Then::Fine(words, check) => {
                assert_eq!(said.code, 0, "case {}, {}: {}", self.number, self.source, said.err);
                let all = said.out + &said.err;
                words.iter().for_each(|w| assert!(all.contains(w), "case {}: {w:?} is not said: {all}", self.number));
                check(&out);
            }
        }
        // What looks at a file may list what is wrong with it, but neither fails nor falls silent.
        let seen = limited(&["inspect", &from]);
        assert!(!seen.err.contains("panicked"), "case {}: {}", self.number, seen.err);
        match seen.code {
            0 => assert!(seen.out.lines().count() > 2, "case {}: {}", self.number, seen.out),
            _ => self.told(&seen, &[]),
        }
    }

    fn told(&self, said: &Said, words: &[&str]) {
        let name = self.names.unwrap_or(&self.source);
        let place = format!("case {}, {}", self.number, self.source);
        assert_eq!(said.code, 3, "{place}: {}{}", said.out, said.err);
        said.refused(3, &[&[name], words].concat());
    }

    /// The same refusal at the doors that lead to the same reader.
    fn elsewhere(&self, from: &str, to: &str, words: &[&str]) {
        let data = data_dir().display().to_string();
        if self.door == Door::Scans && self.arguments.is_empty() {
            let run = format!("{to}.run");
            self.told(&limited(&["train", "--data", from, "--out", &run, "--data-dir", &data]), words);
            assert!(!Path::new(&run).join("config.toml").exists(), "there is no run to resume");
        }
        if self.door == Door::Motion {
            let (bundle, to) = (tiny_run().path.join("bundle").display().to_string(), format!("{to}.glb"));
            let animate = ["animate", "--bundle", &bundle, "--motion", from, "--out", &to];
            self.told(&limited(&[&animate[..], &self.arguments].concat()), words);
            assert!(!Path::new(&to).exists());
        }
    }
}

/// Runs the command with 1.5 GiB of address space and five seconds of processor time.
fn limited(args: &[&str]) -> Said {
    let mut shell = Command::new("sh");
    shell.args(["-c", "ulimit -v 1572864; ulimit -t 5; exec \"$0\" \"$@\""]).arg(command().get_program()).args(args);
    let child = shell.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
    let mut child = child.expect("a shell");
    // What waits uses no processor time: it is ended by the clock.
    let begun = Instant::now();
    while child.try_wait().expect("a child").is_none() {
        if begun.elapsed() > Duration::from_secs(60) {
            let _ = child.kill();
            panic!("{args:?} does not end");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    Said::of(&child.wait_with_output().expect("a child"))
}

/// Runs the cases of a part; each number of `numbers` must have one.
fn run(part: &str, numbers: std::ops::RangeInclusive<u8>, cases: &[Case]) {
    let found: BTreeSet<u8> = cases.iter().map(|c| c.number).collect();
    assert_eq!(found, numbers.collect(), "every case has its number");
    let home: PathBuf = folder(&format!("doors-{part}"));
    let (mut refused, mut failed) = (BTreeSet::new(), Vec::new());
    for case in cases {
        let key = (case.number, case.door as u8);
        let first = matches!(case.then, Then::Refused(_)) && refused.insert(key);
        // All that fail are of interest, not the first alone; each says why when it fails.
        if catch_unwind(AssertUnwindSafe(|| case.run(&home, first))).is_err() {
            failed.push(format!("{} {}", case.number, case.source));
        }
    }
    assert!(failed.is_empty(), "{failed:?}");
}

#[test]
fn meshes_1_to_27() {
    run("meshes", 1..=27, &meshes::cases());
}

#[test]
fn sequences_28_to_38() {
    run("sequences", 28..=38, &sequences::cases());
}

#[test]
fn arrays_and_containers_39_to_49() {
    run("arrays", 39..=49, &arrays::cases());
}
