use std::cmp::Ordering;

/// Orders names as people number files: `frame9` before `frame10`. Runs of digits compare by value, then by
/// length (so that `01` and `1` differ), everything else byte by byte.
pub fn natural_cmp(a: &str, b: &str) -> Ordering {
    let (mut a, mut b) = (a.as_bytes(), b.as_bytes());
    loop {
        match (a.first(), b.first()) {
            (Some(x), Some(y)) if x.is_ascii_digit() && y.is_ascii_digit() => {
                let (na, rest_a) = digits(a);
                let (nb, rest_b) = digits(b);
                let (za, zb) = (strip_zeros(na), strip_zeros(nb));
                let order = za.len().cmp(&zb.len()).then_with(|| za.cmp(zb)).then_with(|| na.len().cmp(&nb.len()));
                if order.is_ne() {
                    return order;
                }
                (a, b) = (rest_a, rest_b);
            }
            (Some(x), Some(y)) => {
                if x != y {
                    return x.cmp(y);
                }
                (a, b) = (&a[1..], &b[1..]);
            }
            _ => return a.len().cmp(&b.len()),
        }
    }
}

fn digits(s: &[u8]) -> (&[u8], &[u8]) {
    s.split_at(s.iter().position(|c| !c.is_ascii_digit()).unwrap_or(s.len()))
}

fn strip_zeros(s: &[u8]) -> &[u8] {
    &s[s.iter().position(|c| *c != b'0').unwrap_or(s.len())..]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nine_comes_before_ten() {
        let mut names = ["f100.obj", "f9.obj", "f10.obj", "f009.obj", "g1.obj", "f.obj"];
        names.sort_by(|a, b| natural_cmp(a, b));
        assert_eq!(names, ["f.obj", "f9.obj", "f009.obj", "f10.obj", "f100.obj", "g1.obj"]);
    }
}
