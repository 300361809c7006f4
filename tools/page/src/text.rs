//! Bytes as text that may stand in a page: 13 bits in two of 91 printable characters, low bits first, which takes 16 bits
//! for 13 where base64 takes 16 for 12.

/// Number of characters that are used.
const BASE: u16 = 91;
/// Bits that two characters hold: 91² is just above 2¹³.
const BITS: u32 = 13;

/// Returns the characters by their values: those of ASCII that print, without `"`, `&` and `<`, which HTML reads.
fn alphabet() -> [u8; BASE as usize] {
    let mut printable = (b'!'..=b'~').filter(|c| !b"\"&<".contains(c));
    std::array::from_fn(|_| printable.next().unwrap_or_default())
}

/// Returns bytes as text; the last 13 bits are filled up with zeros.
pub fn encode(bytes: &[u8]) -> String {
    let alphabet = alphabet();
    let mut text = String::with_capacity((bytes.len() * 8).div_ceil(BITS as usize) * 2);
    let mut put = |value: u16| {
        for digit in [value % BASE, value / BASE] {
            text.push(char::from(alphabet[usize::from(digit)]));
        }
    };
    let (mut held, mut count) = (0u32, 0);
    for &byte in bytes {
        held |= u32::from(byte) << count;
        count += 8;
        if count >= BITS {
            put((held & ((1 << BITS) - 1)) as u16);
            (held, count) = (held >> BITS, count - BITS);
        }
    }
    if count > 0 {
        put(held as u16);
    }
    text
}

/// Returns the first `count` bytes that [`encode`] has made text of; `None` if the text is no such text or is too short.
pub fn decode(text: &str, count: usize) -> Option<Vec<u8>> {
    let mut values = [None; 256];
    for (value, c) in (0u32..).zip(alphabet()) {
        values[usize::from(c)] = Some(value);
    }
    let (pairs, []) = text.as_bytes().as_chunks::<2>() else { return None };
    // The length is a claim of the page.
    let mut bytes = Vec::with_capacity(count.min(text.len()));
    let (mut held, mut bits) = (0u32, 0);
    for &[first, second] in pairs {
        let value = values[usize::from(first)]? + u32::from(BASE) * values[usize::from(second)]?;
        if value >> BITS != 0 {
            return None;
        }
        held |= value << bits;
        bits += BITS;
        while bits >= 8 {
            bytes.push(held as u8);
            (held, bits) = (held >> 8, bits - 8);
        }
    }
    (bytes.len() >= count).then(|| {
        bytes.truncate(count);
        bytes
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_bytes_again_and_stands_in_a_page() {
        let mut state = 7u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let bytes: Vec<u8> = (0..1000).map(|_| next()).collect();
        for count in (0..40).chain([999, 1000]) {
            let text = encode(&bytes[..count]);
            assert_eq!(text.len(), (count * 8).div_ceil(13) * 2);
            assert!(text.bytes().all(|c| c.is_ascii_graphic() && !b"\"&<".contains(&c)), "{text}");
            assert_eq!(decode(&text, count).as_deref(), Some(&bytes[..count]));
        }
        // The order that the page's script knows.
        assert_eq!(encode(&[1]), "#!", "1 is the second character, after '!' and without '\"'");
        assert_eq!(encode(&[91, 0]), "!#!!", "and 91 has its digit behind");
    }

    #[test]
    fn what_is_no_such_text_is_refused() {
        for (text, count) in [("!", 0), ("!!", 2), ("!<", 1), ("~~", 1), ("!\u{e4}", 1), ("! ", 1)] {
            assert_eq!(decode(text, count), None, "{text}");
        }
        assert_eq!(decode("!!", usize::MAX), None, "a length that nothing has");
    }
}
