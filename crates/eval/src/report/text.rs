//! Words and numbers as the report shows them.

use std::cmp::Ordering;

/// Text made safe between tags and in quoted attributes.
pub fn escape(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// A method's name in words.
pub fn method_label(name: &str) -> String {
    let (base, variant) = name.split_once('/').map_or((name, None), |(b, v)| (b, Some(v)));
    let words = match base {
        "body" => "body alone",
        "mean" => "mean displacement",
        "ridge" => "ridge, one frame",
        "ar2-pooled" => "AR(2), pooled",
        "ar2-subject" => "AR(2), per subject",
        "resonators" => "resonator bank",
        "dyna" => "Dyna (2015)",
        "casas-otaduy" => "Casas and Otaduy (2018)",
        "softsmpl" => "SoftSMPL (2020)",
        "autoavatar" => "AutoAvatar (2022)",
        "autoregressive" => "AutoAvatar",
        "pose" => "Pose",
        "pose-tcn" => "PoseTCN",
        "pose-differences" => "Pose + dPose",
        crate::surfaces::STILL => "standing still",
        "oracle" => "simulator, mean flesh",
        other => other,
    };
    variant.map_or_else(|| words.to_owned(), |v| format!("{words} · {v}"))
}

/// Whether a name is a method driven by another pose channel than the main one.
pub fn is_channel(name: &str) -> bool {
    ["/fitted", "/rough", "/exact"].iter().any(|c| name.ends_with(c))
}

/// Baselines from the plainest up, ours last, unknown names before it.
pub fn by_rank(a: &str, b: &str) -> Ordering {
    let rank = |name: &str| {
        let base = name.split('/').next().unwrap_or(name);
        const ORDER: [&str; 11] = [
            "body",
            "mean",
            "ridge",
            "ar2-pooled",
            "ar2-subject",
            "resonators",
            "dyna",
            "casas-otaduy",
            "softsmpl",
            "autoavatar",
            "oracle",
        ];
        let place = ORDER.iter().position(|o| *o == base).unwrap_or(ORDER.len());
        let place = match name {
            crate::OURS => ORDER.len() + 2,
            _ if base == crate::OURS => ORDER.len() + 1,
            _ => place,
        };
        (place, name.len())
    };
    rank(a).cmp(&rank(b)).then_with(|| a.cmp(b))
}

/// A number with about three digits: `0.42`, `12.3`, `1,240`.
pub fn number(x: f64) -> String {
    let size = x.abs();
    if !x.is_finite() {
        return "not finite".into();
    }
    match size {
        s if s >= 1000.0 => thousands(x.round() as i64),
        s if s >= 100.0 => format!("{x:.0}"),
        s if s >= 10.0 => format!("{x:.1}"),
        s if s > 0.0 && s < 5e-4 => "≈ 0".into(),
        s if s >= 0.095 || s == 0.0 => format!("{x:.2}"),
        _ => format!("{x:.3}"),
    }
}

/// An integer with commas.
pub fn thousands(n: i64) -> String {
    let digits = n.unsigned_abs().to_string();
    let groups: Vec<&str> = digits.as_bytes().rchunks(3).rev().filter_map(|g| std::str::from_utf8(g).ok()).collect();
    format!("{}{}", if n < 0 { "-" } else { "" }, groups.join(","))
}

/// Seconds in words: `42 s`, `3 min 20 s`, `5 h 10 min`.
pub fn duration(seconds: f64) -> String {
    let s = seconds.max(0.0);
    match s {
        s if s < 10.0 => format!("{s:.1} s"),
        s if s < 100.0 => format!("{s:.0} s"),
        s if s < 3600.0 => format!("{} min {:02} s", s as u64 / 60, s as u64 % 60),
        s => format!("{} h {:02} min", s as u64 / 3600, s as u64 % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        let shown: Vec<String> = [0.0, 0.0001, 0.0421, 0.42, 3.456, 12.34, 123.4, 1234.5, -0.42].map(number).to_vec();
        assert_eq!(shown, ["0.00", "≈ 0", "0.042", "0.42", "3.46", "12.3", "123", "1,235", "-0.42"]);
        assert_eq!(thousands(-1_234_567), "-1,234,567");
        assert_eq!([3.21, 42.0, 200.0, 18_600.0].map(duration), ["3.2 s", "42 s", "3 min 20 s", "5 h 10 min"]);
    }

    #[test]
    fn names_cannot_leave_their_place() {
        assert_eq!(escape("<b a=\"'&\">"), "&lt;b a=&quot;&#39;&amp;&quot;&gt;");
        assert_eq!(method_label("ar2-subject/dyna"), "AR(2), per subject · dyna");
        assert!(is_channel("ridge/rough") && !is_channel("ar2-subject/dyna"));
    }

    #[test]
    fn ours_comes_last_and_the_body_first() {
        let mut names =
            vec!["softtissue", "zeta", "softtissue/no-shortcut", "body", "ar2-subject/dyna", "ridge", "ar2-subject"];
        names.sort_by(|a, b| by_rank(a, b));
        assert_eq!(
            names,
            ["body", "ridge", "ar2-subject", "ar2-subject/dyna", "zeta", "softtissue/no-shortcut", "softtissue"]
        );
    }
}
