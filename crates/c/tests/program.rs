//! A C program, compiled with the header and linked with the library, against the player in Rust.

#[path = "../../bundle/tests/bundle/tiny.rs"]
#[expect(dead_code, reason = "shared with the player's own tests")]
mod tiny;

use softtissue_body::{Pose, Region};
use softtissue_bundle::{Control, Controls, Player};
use std::path::{Path, PathBuf};
use std::process::Command;

const FRAMES: usize = 40;

/// The shared library beside this test.
fn library() -> PathBuf {
    let here = std::env::current_exe().expect("this test");
    let folder = here.parent().expect("a folder");
    let name = format!("{}softtissue_player{}", std::env::consts::DLL_PREFIX, std::env::consts::DLL_SUFFIX);
    let found = [folder.join(&name), folder.join("..").join(&name)].into_iter().find(|p| p.exists());
    found.unwrap_or_else(|| panic!("no {name} beside {}", here.display()))
}

fn run(command: &mut Command) -> String {
    let done = command.output().unwrap_or_else(|e| panic!("{command:?}: {e}"));
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(done.status.success(), "{command:?}: {said}");
    assert!(said.is_empty(), "{command:?} complains: {said}");
    String::from_utf8(done.stdout).expect("text")
}

fn compiled(source: &Path, out: &Path, options: &[&str]) {
    let home = Path::new(env!("CARGO_MANIFEST_DIR"));
    let library = library();
    let folder = library.parent().expect("a folder");
    let mut cc = Command::new(std::env::var("CC").unwrap_or_else(|_| "cc".into()));
    cc.args(options).args(["-Wall", "-Wextra", "-Werror", "-I"]).arg(home.join("include"));
    cc.arg(source).arg("-o").arg(out).arg(&library).arg("-lm");
    run(cc.arg(format!("-Wl,-rpath,{}", folder.display())));
}

#[cfg(unix)]
#[test]
fn a_program_in_c_plays_what_the_player_plays() {
    let dir = tempfile::tempdir().expect("a folder");
    let bundle = tiny::bundle(tiny::Parts::default());
    let home = dir.path().join("bundle");
    bundle.write(&home).expect("a bundle");
    let (rotations, translations) = tiny::motion(FRAMES);
    let mut bytes = vec![];
    for (t, root) in translations.iter().enumerate() {
        for v in rotations.frame(t).iter().chain([root]) {
            v.to_array().iter().for_each(|x| bytes.extend(x.to_le_bytes()));
        }
    }
    let motion = dir.path().join("motion");
    std::fs::write(&motion, bytes).expect("a motion");

    let program = dir.path().join("program");
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/program.c");
    compiled(&source, &program, &["-std=c99"]);
    let said = run(Command::new(&program).arg(&home).arg(FRAMES.to_string()).arg(&motion));

    let mut player = Player::new(&bundle, &[0.5, -1.0]).expect("a player");
    let belly = Control { gain: 1.5, ..Default::default() };
    player.set_controls(&Controls { regions: vec![(Region::Belly, belly)], ..Default::default() }).expect("a gain");
    for (t, translation) in translations.iter().enumerate() {
        player.step(Pose { rotations: rotations.frame(t), translation: *translation });
    }
    let deltas = player.deltas().to_vec();
    let expected: Vec<[f32; 2]> = deltas
        .iter()
        .zip(player.vertices())
        .flat_map(|(d, v)| d.to_array().into_iter().zip(v.to_array()).map(|(d, v)| [d, v]))
        .collect();
    assert!(deltas.iter().any(|d| d.length() > 1e-6), "nothing moves");
    let found: Vec<[f32; 2]> = said
        .lines()
        .map(|l| {
            let (d, v) = l.split_once(' ').expect("two numbers");
            [hexadecimal(d), hexadecimal(v)]
        })
        .collect();
    assert_eq!(found, expected);
}

/// C's `%a`.
fn hexadecimal(text: &str) -> f32 {
    let (sign, text) = text.strip_prefix('-').map_or((1.0, text), |t| (-1.0, t));
    let (digits, power) = text.strip_prefix("0x").and_then(|t| t.split_once('p')).expect("hexadecimal digits");
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    let mantissa = u64::from_str_radix(&format!("{whole}{part}"), 16).expect("digits");
    let power: i32 = power.parse().expect("a power");
    (sign * mantissa as f64 * 2f64.powi(power - 4 * part.len() as i32)) as f32
}

#[cfg(unix)]
#[test]
fn the_snippet_of_the_documentation_runs() {
    let dir = tempfile::tempdir().expect("a folder");
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/play.md");
    let page = std::fs::read_to_string(page).expect("the page");
    let (_, rest) = page.split_once("```c\n").expect("a snippet");
    let source = dir.path().join("snippet.c");
    std::fs::write(&source, rest.split_once("```").expect("its end").0).expect("a program");
    let bundle = dir.path().join("bundle");
    tiny::bundle(tiny::Parts::default()).write(&bundle).expect("a bundle");
    let program = dir.path().join("snippet");
    compiled(&source, &program, &[]);
    let height: f32 = run(Command::new(&program).arg(&bundle)).trim().parse().expect("a number");
    assert!(height.is_finite());
    let nothing = Command::new(&program).arg("/nowhere").output().expect("the program");
    assert!(String::from_utf8_lossy(&nothing.stderr).contains("/nowhere"));
}

#[cfg(unix)]
#[test]
fn the_header_is_c_plus_plus_too_and_names_every_function() {
    let dir = tempfile::tempdir().expect("a folder");
    let home = Path::new(env!("CARGO_MANIFEST_DIR"));
    let source = dir.path().join("program.cpp");
    let text = "#include \"softtissue.h\"\nint main() { return softtissue_bundle_open(nullptr) != nullptr; }\n";
    std::fs::write(&source, text).expect("a program");
    compiled(&source, &dir.path().join("program"), &[]);
    run(&mut Command::new(dir.path().join("program")));

    let header = std::fs::read_to_string(home.join("include/softtissue.h")).expect("the header");
    let code = std::fs::read_to_string(home.join("src/lib.rs")).expect("the library");
    let names = |text: &str, before: &str, after: &str| -> Vec<String> {
        let pieces = text.split(before).skip(1).filter_map(|rest| rest.split_once(after));
        let mut names: Vec<String> = pieces.map(|(name, _)| format!("softtissue_{name}")).collect();
        names.sort();
        names
    };
    let mut exported = names(&code, "extern \"C\" fn softtissue_", "(");
    exported.extend(code.lines().filter_map(|l| {
        let (name, rest) = l.trim().strip_prefix("softtissue_")?.split_once(": ")?;
        rest.contains("= |b|").then(|| format!("softtissue_{name}"))
    }));
    assert!(exported.len() > 15, "{exported:?}");
    for name in exported {
        assert!(header.contains(&format!("{name}(")), "{name} is not in the header");
    }
}
