//! The card of what hands and buttons do, for those who have never held them: what to do, and what it does.

/// What controllers do.
pub const CONTROLLERS: [[&str; 2]; 9] = [
    ["Grip, one hand", "carry the patient"],
    ["Grip, both hands", "turn, move and scale; real size snaps"],
    ["Trigger", "click on the panel; measure, when that is on"],
    ["Thumbstick, right", "level up and down, width sideways"],
    ["Thumbstick pressed", "show or hide the panel"],
    ["A, X", "next preset, previous preset"],
    ["B", "cutting plane: in the hand, fixed, off"],
    ["Y", "undo; hold for a second to reset"],
    ["Grip on the panel's frame", "carry the panel"],
];

/// What hands without controllers do.
pub const BARE: [[&str; 2]; 3] = [
    ["Grasp", "carry, and with both hands turn and scale"],
    ["Pinch", "click on the panel"],
    ["Open palm before the eyes", "show or hide the panel"],
];

/// Heading of the card.
pub const HEADING: &str = "Controls";
/// Last line of the card.
pub const CLOSING: &str = "Pull a trigger to close this card. For looking, not for diagnosis.";
