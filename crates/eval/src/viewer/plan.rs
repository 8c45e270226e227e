/// Points that a page holds at most, over all clips, layers and frames: some 30 MB of file.
pub const MOST_POINTS: usize = 8_000_000;
/// Points of clips that nobody asked for by name.
const UNASKED_POINTS: usize = 2_000_000;
/// Clips that nobody asked for by name.
const UNASKED_CLIPS: usize = 6;

/// Which frames of a clip are shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pick {
    /// The first.
    pub start: usize,
    /// One of so many is shown.
    pub every: usize,
    /// How many are shown.
    pub count: usize,
}

impl Pick {
    /// Their numbers.
    pub fn frames(&self) -> impl Iterator<Item = usize> {
        (0..self.count).map(|i| self.start + i * self.every)
    }
}

/// What of a list of clips fits into a page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Which frames of the first clips are shown; the others are left out.
    pub picks: Vec<Pick>,
    /// One of so many frames is shown.
    pub every: usize,
}

/// Chooses what of clips with these `ranges` of frames is shown, at `points` a frame (vertices times layers). Clips that
/// were `asked` for are all shown, thinned alike where they have more than [`MOST_POINTS`]; of others the first and what
/// of the next is small.
pub fn plan(ranges: &[std::ops::Range<usize>], points: usize, asked: bool) -> Plan {
    let size = |r: &std::ops::Range<usize>| r.len().saturating_mul(points);
    let mut shown = ranges;
    if !asked {
        let mut used = 0usize;
        let fits = |r: &&std::ops::Range<usize>| {
            used = used.saturating_add(size(r));
            used <= UNASKED_POINTS
        };
        let fitting = ranges.iter().take(UNASKED_CLIPS).take_while(fits).count();
        shown = &ranges[..fitting.max(1).min(ranges.len())];
    }
    let total = |every: usize| {
        let kept = |r: &std::ops::Range<usize>| r.len().div_ceil(every).saturating_mul(points);
        shown.iter().map(kept).fold(0usize, usize::saturating_add)
    };
    let longest = shown.iter().map(std::ops::Range::len).max().unwrap_or(0).max(1);
    let mut every = (total(1) / MOST_POINTS).clamp(1, longest);
    while every < longest && total(every) > MOST_POINTS {
        every += 1;
    }
    let pick = |r: &std::ops::Range<usize>| Pick { start: r.start, every, count: r.len().div_ceil(every) };
    Plan { picks: shown.iter().map(pick).collect(), every }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(range: std::ops::Range<usize>, points: usize) -> Plan {
        plan(&[range], points, true)
    }

    #[test]
    fn what_is_small_is_shown_whole_and_what_is_large_is_thinned() {
        let whole = |n: usize| Pick { start: 0, every: 1, count: n };
        // three clips of 300 frames, 1724 vertices in three layers: one fits, and with it nothing that nobody asked for
        let ranges = [0..300, 0..300, 0..300];
        assert_eq!(plan(&ranges, 3 * 1724, false).picks, [whole(300)]);
        assert_eq!(plan(&ranges, 3 * 1724, true).picks, [whole(300); 3]);
        assert_eq!(plan(&std::iter::repeat_n(0..10, 20).collect::<Vec<_>>(), 100, false).picks.len(), UNASKED_CLIPS);
        // a range of a clip keeps its place
        let part = one(40..70, 6890);
        assert_eq!(part.picks, [Pick { start: 40, every: 1, count: 30 }]);
        let long = one(10..3010, 6890 * 3);
        assert_eq!(long.every, 8);
        let pick = long.picks[0];
        assert!(pick.count * 6890 * 3 <= MOST_POINTS);
        assert_eq!((pick.frames().next(), pick.frames().last()), (Some(10), Some(10 + 8 * 374)));
    }

    #[test]
    fn nothing_overflows_and_nothing_is_nothing() {
        assert_eq!(plan(&[], 100, false), Plan { picks: vec![], every: 1 });
        let huge = one(0..5, usize::MAX);
        assert_eq!(huge.picks, [Pick { start: 0, every: 5, count: 1 }], "one frame is left, which `write` refuses");
    }
}
