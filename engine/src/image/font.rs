//! A font of 5 by 8 pixels, drawn for this program: enough for names, numbers and units, with nothing to
//! install. Letters stand on the seventh row; tails reach below it.

/// Width of a letter's cell, pixels: five and a gap.
pub const ADVANCE: usize = 6;
/// Height of a letter, pixels.
pub const HEIGHT: usize = 8;
const WIDTH: usize = 5;

/// The seven rows of each letter without a tail, one byte per row from the top; bit 4 is the leftmost pixel.
#[rustfmt::skip]
const GLYPHS: &[(char, u64)] = &[
    ('A', 0x0E11111F111111), ('B', 0x1E11111E11111E), ('C', 0x0E11101010110E), ('D', 0x1E11111111111E),
    ('E', 0x1F10101E10101F), ('F', 0x1F10101E101010), ('G', 0x0E11101711110F), ('H', 0x1111111F111111),
    ('I', 0x0E04040404040E), ('J', 0x0702020202120C), ('K', 0x11121418141211), ('L', 0x1010101010101F),
    ('M', 0x111B1515111111), ('N', 0x11111915131111), ('O', 0x0E11111111110E), ('P', 0x1E11111E101010),
    ('Q', 0x0E11111115120D), ('R', 0x1E11111E141211), ('S', 0x0F10100E01011E), ('T', 0x1F040404040404),
    ('U', 0x1111111111110E), ('V', 0x11111111110A04), ('W', 0x11111115151B11), ('X', 0x11110A040A1111),
    ('Y', 0x11110A04040404), ('Z', 0x1F01020408101F), ('a', 0x00000E010F110F), ('b', 0x10101E1111111E),
    ('c', 0x00000E1010110E), ('d', 0x01010F1111110F), ('e', 0x00000E111F100E), ('f', 0x0609081C080808),
    ('h', 0x10101619111111), ('i', 0x04000C0404040E),
    ('k', 0x10101214181412), ('l', 0x0C04040404040E), ('m', 0x00001A15151111), ('n', 0x00001619111111),
    ('o', 0x00000E1111110E), ('r', 0x00001619101010),
    ('s', 0x00000E100E011E), ('t', 0x08081C08080906), ('u', 0x0000111111130D), ('v', 0x00001111110A04),
    ('w', 0x0000111115150A), ('x', 0x0000110A040A11), ('z', 0x00001F0204081F),
    ('0', 0x0E11131519110E), ('1', 0x040C040404040E), ('2', 0x0E11010204081F), ('3', 0x1F02040201110E),
    ('4', 0x02060A121F0202), ('5', 0x1F101E0101110E), ('6', 0x0608101E11110E), ('7', 0x1F010204080808),
    ('8', 0x0E11110E11110E), ('9', 0x0E11110F01020C), ('.', 0x00000000000C0C),
    (':', 0x000C0C000C0C00), ('-', 0x0000000E000000), ('+', 0x0004041F040400),
    ('=', 0x00001F001F0000), ('/', 0x00010204081000), ('(', 0x02040808080402), (')', 0x08040202020408),
    ('%', 0x18190204081303), ('_', 0x0000000000001F), ('*', 0x0004150E150400), ('<', 0x02040810080402),
    ('>', 0x08040201020408), ('!', 0x04040404000004), ('?', 0x0E110102040004),
    ('\'', 0x0C040800000000), ('"', 0x0A0A0A00000000), ('#', 0x0A0A1F0A1F0A0A),
    ('[', 0x0E08080808080E), (']', 0x0E02020202020E), ('&', 0x0C12140815120D), ('@', 0x0E11010D15150E),
    ('~', 0x00000815020000), ('|', 0x04040404040404), ('∞', 0x00000A15150A00), ('±', 0x04041F0404001F),
    ('×', 0x00110A040A1100),
];

/// The eight rows of letters with a tail.
#[rustfmt::skip]
const TAILED: &[(char, u64)] = &[
    ('g', 0x00000F11110F010E), ('j', 0x020006020202120C), ('p', 0x00001E11111E1010), ('q', 0x00000F11110F0101),
    ('y', 0x00001111110F010E), (',', 0x00000000000C0408), (';', 0x00000C0C000C0408),
];

/// The glyph of letters that are in no table: an empty frame.
const UNKNOWN: u64 = 0x1F11_1111_1111_1F00;

/// Returns the pixels of a letter that are set, as column and row.
pub fn pixels(letter: char) -> impl Iterator<Item = (usize, usize)> {
    let rows = match letter {
        ' ' => 0,
        '−' => rows_of('-'),
        _ => rows_of(letter),
    };
    (0..HEIGHT * WIDTH).map(|i| (i % WIDTH, i / WIDTH)).filter(move |(x, y)| {
        let row = rows >> (8 * (HEIGHT - 1 - y)) & 0x1F;
        row >> (WIDTH - 1 - x) & 1 == 1
    })
}

fn rows_of(letter: char) -> u64 {
    let of = |(c, rows): &(char, u64)| (*c == letter).then_some(*rows);
    TAILED.iter().find_map(of).or_else(|| Some(GLYPHS.iter().find_map(of)? << 8)).unwrap_or(UNKNOWN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_there_once_and_fit_their_cell() {
        let all: Vec<(char, u64)> = GLYPHS.iter().chain(TAILED).copied().collect();
        for (i, (letter, rows)) in all.iter().enumerate() {
            assert!(all[..i].iter().all(|(c, _)| c != letter), "{letter} twice");
            assert_eq!(rows & !0x1F1F_1F1F_1F1F_1F1F, 0, "{letter} leaves its cell");
            assert!(pixels(*letter).count() > 1, "{letter} is empty");
            let has_tail = pixels(*letter).any(|(_, row)| row + 1 == HEIGHT);
            assert_eq!(has_tail, TAILED.iter().any(|(c, _)| c == letter), "{letter}");
        }
        for letter in ('a'..='z').chain('A'..='Z').chain('0'..='9').chain("+-.,:()/%".chars()) {
            assert!(all.iter().any(|(c, _)| *c == letter), "{letter} is missing");
        }
        assert_eq!(pixels(' ').count(), 0);
        assert!(pixels('漢').count() > 10, "an unknown letter is a frame");
    }
}
