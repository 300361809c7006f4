//! Style of the panels: egui's dark style, a little denser and with the grey of a reading room.

use egui::{Color32, Context, CornerRadius, FontFamily, FontId, Stroke, TextStyle, Theme, vec2};
use glam::DVec3;

/// Colour of what is active or selected.
pub const ACCENT: Color32 = Color32::from_rgb(86, 156, 214);

/// Colour of measurements and warnings.
pub const SIGNAL: Color32 = Color32::from_rgb(240, 200, 90);

/// Gives a context the style of the viewer.
pub fn apply(context: &Context) {
    context.set_theme(Theme::Dark);
    context.style_mut_of(Theme::Dark, |style| {
        for (text, size) in [
            (TextStyle::Small, 10.5),
            (TextStyle::Body, 13.0),
            (TextStyle::Button, 13.0),
            (TextStyle::Heading, 15.0),
        ] {
            style.text_styles.insert(text, FontId::new(size, FontFamily::Proportional));
        }
        style.text_styles.insert(TextStyle::Monospace, FontId::new(12.0, FontFamily::Monospace));
        style.spacing.item_spacing = vec2(6.0, 5.0);
        style.spacing.button_padding = vec2(7.0, 3.0);
        style.spacing.slider_width = 130.0;
        style.spacing.interact_size.y = 20.0;
        style.spacing.tooltip_width = 320.0;
        style.interaction.selectable_labels = false;
        let visuals = &mut style.visuals;
        visuals.panel_fill = Color32::from_gray(30);
        visuals.window_fill = Color32::from_gray(34);
        visuals.extreme_bg_color = Color32::from_gray(18);
        visuals.faint_bg_color = Color32::from_gray(36);
        visuals.selection.bg_fill = ACCENT.gamma_multiply(0.55);
        visuals.selection.stroke = Stroke::new(1.0, Color32::WHITE);
        visuals.hyperlink_color = ACCENT;
        visuals.window_corner_radius = CornerRadius::same(6);
        visuals.widgets.noninteractive.bg_stroke = Stroke::new(1.0, Color32::from_gray(50));
        visuals.widgets.noninteractive.fg_stroke = Stroke::new(1.0, Color32::from_gray(190));
        visuals.widgets.inactive.fg_stroke = Stroke::new(1.0, Color32::from_gray(215));
        visuals.slider_trailing_fill = true;
        // A blinking cursor would draw frames while nothing happens.
        visuals.text_cursor.blink = false;
    });
}

/// Converts a display-referred colour for egui.
pub(crate) fn screen(colour: DVec3) -> Color32 {
    let [r, g, b] = bytes_of(colour);
    Color32::from_rgb(r, g, b)
}

/// Converts a display-referred colour to bytes.
pub(crate) fn bytes_of(colour: DVec3) -> [u8; 3] {
    colour.to_array().map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8)
}
