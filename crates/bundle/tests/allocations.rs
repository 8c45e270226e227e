//! A playing player allocates nothing.

#![allow(unsafe_code, reason = "an allocator that counts cannot be written without; it only forwards to the system's")]

#[path = "bundle/tiny.rs"]
#[allow(dead_code, reason = "this binary needs a part of it")]
mod tiny;

use softtissue_body::{Pose, Region};
use softtissue_bundle::{Batch, Control, Controls, Detail, Player, Precision};
use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

struct Counting;
thread_local! {
    /// Of this thread: the test's harness allocates when it likes.
    static COUNT: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_step_allocates_nothing() {
    let (rotations, translations) = tiny::motion(60);
    let disentangled = softtissue_bundle::descriptor::FeatureKind::DisentangledPose;
    let bundles = [
        tiny::bundle(tiny::Parts::default()),
        tiny::bundle(tiny::Parts { look_ahead: 3, ..Default::default() }),
        tiny::bundle(tiny::Parts { features: disentangled, bank: false, ..Default::default() }),
        tiny::autoregressive(),
        tiny::bundle(tiny::Parts::default()).reduced(Precision::F16).unwrap(),
        tiny::bundle(tiny::Parts::default()).reduced(Precision::I8).unwrap(),
    ];
    for bundle in bundles {
        let mut player = Player::new(&bundle, &[0.5]).unwrap();
        let pose = |t: usize| Pose { rotations: rotations.frame(t), translation: translations[t] };
        let has_bank = bundle.model.recurrent().is_some_and(|m| m.regressor.bank.is_some());
        let damping = if has_bank { 0.5 } else { 1.0 };
        let region = Control { softness: 1.5, damping, lag: 0.04, ..Default::default() };
        let controls = Controls { regions: vec![(Region::Feet, region)], ..Controls::gain(1.2) };
        let mut controlled = Player::new(&bundle, &[0.5]).unwrap();
        controlled.set_controls(&controls).unwrap();
        controlled.show_on(Some(bundle.body.template.clone())).unwrap();
        controlled.set_detail(&Detail { components: Some(3), still: vec![Region::Feet] }).unwrap();
        let mut batch = Batch::new(&bundle, &[&[0.1], &[0.2], &[0.3]], 1).unwrap();
        let before = COUNT.get();
        assert!(before > 100, "the counter counts");
        for t in 0..60 {
            player.step(pose(t));
            player.vertices();
            player.advance(pose(t), 0.01);
            controlled.step(pose(t));
            controlled.vertices();
            batch.step(&[pose(t); 3]).unwrap();
        }
        assert_eq!(COUNT.get() - before, 0, "{}", bundle.info.method);
    }
}
