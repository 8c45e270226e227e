//! The folder is whole, refers to nothing outside itself, and is served as it is written.

#[path = "../../bundle/tests/bundle/tiny.rs"]
#[expect(dead_code, reason = "shared with the player's own tests")]
mod tiny;

use softtissue_bundle::{Bundle, BundleFiles};
use softtissue_clips::{ClipId, MotionClip};
use softtissue_page::{PageError, Server, Site};
use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::atomic::{AtomicBool, Ordering};

/// Stands in for the player, which the site only carries.
const PLAYER: &[u8] = b"\0asm";

fn site() -> Site {
    let dir = tempfile::tempdir().expect("a folder");
    let bundle = tiny::bundle(tiny::Parts::default());
    bundle.write(dir.path()).expect("a bundle");
    let files = BundleFiles::read(dir.path()).expect("its files");
    let (rotations, translations) = tiny::motion(12);
    let clip = |name| MotionClip {
        id: ClipId::new("anybody", name, 0),
        fps: 60.0,
        rotations: rotations.clone(),
        translations: translations.clone(),
    };
    Site::new("a \"person\"", &bundle, &files, &[clip("shake_hips"), clip("knees")], PLAYER).expect("a site")
}

/// Names between quotes that look like files, in text that a browser runs.
fn references(text: &str) -> BTreeSet<&str> {
    let quoted = text.split(['"', '\'', '`']);
    let like_a_file = |s: &&str| {
        let known = ["js", "css", "html", "wasm", "json", "safetensors", "png", "svg", "woff2"];
        let ending = s.rsplit_once('.').map(|(_, e)| e);
        ending.is_some_and(|e| known.contains(&e)) && !s.contains(char::is_whitespace) && !s.starts_with('.')
            || s.starts_with("./")
    };
    quoted.filter(like_a_file).map(|s| s.trim_start_matches("./")).collect()
}

#[test]
fn the_folder_is_whole_and_refers_to_nothing_outside() {
    let (site, dir) = (site(), tempfile::tempdir().expect("a folder"));
    let page = site.write(&dir.path().join("page")).expect("a folder");
    assert!(page.ends_with("page/index.html"));
    let mut named = BTreeSet::new();
    for file in site.files() {
        let written = std::fs::read(dir.path().join("page").join(&file.name)).expect("each file");
        assert_eq!(written, &*file.bytes, "{}", file.name);
        let Some("html" | "css" | "js" | "json") = file.name.rsplit('.').next() else { continue };
        // What the bundle's manifest says is for the player.
        if file.name.starts_with("bundle/") {
            continue;
        }
        let text = std::str::from_utf8(&file.bytes).expect("text");
        for outside in ["http:", "https:", "//cdn", "@import", "url("] {
            assert!(!text.contains(outside), "{} says {outside}", file.name);
        }
        for reference in references(text) {
            assert!(site.at(&format!("/{reference}")).is_some(), "{} refers to {reference}", file.name);
            named.insert(reference.to_owned());
        }
    }
    // And nothing lies there that nobody asks for.
    let all: BTreeSet<String> = site.files().iter().skip(1).map(|f| f.name.clone()).collect();
    assert_eq!(named, all);
}

#[test]
fn what_the_page_loads_is_what_went_in() {
    let site = site();
    let at = |name: &str| site.at(name).expect("a file").bytes.to_vec();
    let facts: serde_json::Value = serde_json::from_slice(&at("/facts.json")).expect("JSON");
    assert_eq!(facts["title"], "a \"person\"");
    assert_eq!(facts["motions"][0]["name"], "shake hips");
    let [manifest, body, model] = [0, 1, 2].map(|i| at(&format!("/{}", facts["bundle"][i].as_str().expect("a name"))));
    let bytes = PLAYER.len() + manifest.len() + body.len() + model.len();
    assert_eq!(facts["bytes"], bytes);
    Bundle::from_memory(BundleFiles { manifest, body, model }).expect("the same bundle");
    let dir = tempfile::tempdir().expect("a folder");
    let file = dir.path().join("motion.safetensors");
    std::fs::write(&file, at("/motions/2.safetensors")).expect("a file");
    let clip = MotionClip::read(&file).expect("a clip");
    assert_eq!((clip.id.motion.as_str(), clip.len(), clip.rotations), ("knees", 12, tiny::motion(12).0));
}

/// The answer to some bytes, whole.
fn answer(port: &str, asked: &str) -> String {
    let mut stream = TcpStream::connect(port).expect("a connection");
    let _ = stream.write_all(asked.as_bytes());
    let mut said = Vec::new();
    // A refused request may end in a reset.
    let _ = stream.read_to_end(&mut said);
    String::from_utf8_lossy(&said).into_owned()
}

#[test]
fn the_server_hands_out_the_site_and_nothing_else() {
    let server = Server::new(site(), 0).expect("a port");
    let address = server.address();
    let port = address.strip_prefix("http://").and_then(|a| a.strip_suffix('/')).expect("an address");
    let busy = Server::new(site(), port.rsplit(':').next().expect("a port").parse().expect("a number"));
    assert!(matches!(&busy, Err(PageError::Port { .. })));
    assert!(busy.err().is_some_and(|e| e.to_string().contains("choose another with --port")));
    let stop = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let running = scope.spawn(|| server.run(|| stop.load(Ordering::Relaxed)));
        let ask = |line: &str, host: &str| {
            answer(port, &format!("{line} HTTP/1.1\r\nHost: {host}\r\nConnection: close\r\n\r\n"))
        };
        let page = ask("GET /", port);
        assert!(page.starts_with("HTTP/1.1 200") && page.contains("text/html") && page.contains("main.js"), "{page}");
        assert!(ask("GET /player.wasm", port).contains("application/wasm"));
        // Connections that never ask for anything, as browsers open them ahead of time, keep nobody waiting.
        let idle: Vec<TcpStream> = (0..8).map(|_| TcpStream::connect(port).expect("a connection")).collect();
        assert!(ask("GET /main.js?again", port).contains("text/javascript"));
        drop(idle);
        // Words that are no request, and one that is too long, are dropped.
        assert_eq!(answer(port, "\r\n\r\n"), "");
        let long = answer(port, &format!("GET /{} HTTP/1.1\r\n", "x".repeat(20_000)));
        assert!(!long.starts_with("HTTP/1.1 200"), "{long}");
        for (line, host, code) in [
            ("GET /../Cargo.toml", port, "404"),
            ("GET /bundle/../../../etc/passwd", port, "404"),
            ("GET /%2e%2e/Cargo.toml", port, "404"),
            ("GET //main.js", port, "404"),
            ("POST /", port, "405"),
            ("DELETE /main.js", port, "405"),
            ("GET /", "elsewhere.example", "421"),
        ] {
            let said = ask(line, host);
            assert!(said.starts_with(&format!("HTTP/1.1 {code}")), "{line} of {host}: {said}");
        }
        stop.store(true, Ordering::Relaxed);
        running.join().expect("no panic").expect("it ends in peace");
    });
}

#[test]
fn a_build_without_the_player_says_how_to_get_one() {
    match softtissue_page::player_module() {
        Ok(module) => assert!(module.starts_with(PLAYER)),
        Err(e) => assert!(e.to_string().contains("--features web"), "{e}"),
    }
}
