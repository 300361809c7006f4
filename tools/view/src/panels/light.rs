//! Panel of the light: where it comes from, and how surfaces respond to it.

use egui::{Color32, Pos2, Rect, Response, Sense, Slider, Stroke, Ui, vec2};
use engine::transfer::{FixedTo, Light, MOST_FILL};
use glam::DVec3;

use super::widgets::row;
use crate::model::state::ViewState;
use crate::panels::theme::SIGNAL;

/// Edge of the ball that shows the light, points of the screen.
const BALL: f32 = 84.0;
/// Share of its radius within which the light stays, so that it is never quite from the side.
const REACH: f64 = 0.98;

/// Shows the light and how surfaces respond to it, and changes both.
pub fn show(ui: &mut Ui, state: &mut ViewState) {
    shade(ui, state);
    ui.add_enabled_ui(state.transfer.material.shade, |ui| {
        direction(ui, state);
        material(ui, state);
    });
}

/// Shows how surfaces respond to light, and changes it; the light itself stays where it is.
pub fn response(ui: &mut Ui, state: &mut ViewState) {
    shade(ui, state);
    ui.add_enabled_ui(state.transfer.material.shade, |ui| material(ui, state));
}

fn shade(ui: &mut Ui, state: &mut ViewState) {
    ui.checkbox(&mut state.transfer.material.shade, "Light")
        .on_hover_text("light surfaces (Blinn-Phong); otherwise colours appear as they are");
}

/// Shows a ball under the light, on which it is dragged, and what the light is fixed to.
fn direction(ui: &mut Ui, state: &mut ViewState) {
    let axes = state.orbit.axes();
    let light = &mut state.light;
    ui.horizontal(|ui| {
        ball(ui, light, axes).on_hover_text("drag to move the light; in the picture, Ctrl and drag");
        ui.vertical(|ui| {
            ui.horizontal(|ui| {
                let headlight = ui.small_button("Headlight");
                if headlight.on_hover_text("from the viewer: both sides of the body look alike").clicked() {
                    *light = Light { fill: light.fill, ..Light::HEAD };
                }
                if ui
                    .small_button("Usual")
                    .on_hover_text("from the upper left, without a second light")
                    .clicked()
                {
                    *light = Light::default();
                }
            });
            ui.horizontal(|ui| {
                for (to, name, help) in [
                    (FixedTo::Camera, "with the camera", "the light turns with the camera"),
                    (FixedTo::Patient, "with the patient", "the light turns with the patient"),
                ] {
                    let chosen = light.fixed_to == to;
                    if ui.selectable_label(chosen, name).on_hover_text(help).clicked() && !chosen {
                        light.fix(to, axes);
                    }
                }
            });
            ui.horizontal(|ui| {
                let help = "strength of a second light from the other side: at 0.5 both sides look alike";
                ui.label("Fill").on_hover_text(help);
                ui.add(Slider::new(&mut light.fill, 0.0..=MOST_FILL).max_decimals(2)).on_hover_text(help);
            });
        });
    });
}

/// Shows the ball.
fn ball(ui: &mut Ui, light: &mut Light, axes: [DVec3; 3]) -> Response {
    let (rect, response) = ui.allocate_exact_size(vec2(BALL, BALL), Sense::click_and_drag());
    let radius = 0.5 * BALL - 2.0;
    if let Some(at) = response.interact_pointer_pos() {
        let from = (at - rect.center()) / radius;
        light.aim(on_ball(DVec3::new(f64::from(from.x), -f64::from(from.y), 0.0)), axes);
    }
    let seen = light.seen(axes);
    let place = |share: f32| rect.center() + vec2(seen.x as f32, -seen.y as f32) * (share * radius);
    paint(ui, rect, radius, seen.z >= 0.0, place);
    response
}

/// Paints a ball that shines towards the light, and the light on it; hollow if it is behind.
fn paint(ui: &Ui, rect: Rect, radius: f32, before: bool, place: impl Fn(f32) -> Pos2) {
    const RINGS: u8 = 10;
    let painter = ui.painter();
    painter.circle_filled(rect.center(), radius, Color32::from_gray(48));
    for ring in 1..=RINGS {
        let share = f32::from(ring) / f32::from(RINGS);
        // Rings shrink towards the light and stay within the ball.
        let middle = rect.center() + (place(1.0) - rect.center()) * (0.8 * share);
        let within = radius - (middle - rect.center()).length();
        painter.circle_filled(middle, within * (1.0 - 0.7 * share), Color32::from_gray(48 + 14 * ring));
    }
    painter.circle_stroke(rect.center(), radius, Stroke::new(1.0, Color32::from_gray(110)));
    let fill = if before { SIGNAL } else { Color32::TRANSPARENT };
    painter.circle(place(1.0), 5.0, fill, Stroke::new(1.5, if before { Color32::BLACK } else { SIGNAL }));
}

/// Returns the direction towards the viewer's side of a ball of radius 1, at a place of its picture.
fn on_ball(place: DVec3) -> DVec3 {
    let flat = DVec3::new(place.x, place.y, 0.0).clamp_length_max(REACH);
    flat + DVec3::Z * (1.0 - flat.length_squared()).max(0.0).sqrt()
}

/// Moves the light as a drag in the picture does: it follows the cursor over a ball of this radius, points of the screen.
pub(crate) fn drag(light: &mut Light, by: egui::Vec2, radius: f32, axes: [DVec3; 3]) {
    let seen = light.seen(axes);
    // A light from behind lights as one from before does, since both sides of a surface are lit alike.
    let seen = if seen.z < 0.0 { -seen } else { seen };
    let by = by / radius.max(1.0);
    light.aim(on_ball(seen + DVec3::new(f64::from(by.x), -f64::from(by.y), 0.0)), axes);
}

fn material(ui: &mut Ui, state: &mut ViewState) {
    let material = &mut state.transfer.material;
    for (name, help, value, most) in [
        ("Ambient", "part of the colour that needs no light (ambient)", &mut material.ambient, 1.0),
        (
            "Diffuse",
            "part of the colour that depends on the angle to the light (diffuse)",
            &mut material.diffuse,
            1.0,
        ),
        ("Specular", "strength of the highlight", &mut material.specular, 1.0),
        ("Shininess", "exponent of the highlight: larger is smaller and sharper", &mut material.power, 100.0),
        (
            "Occlusion",
            "part of the light that crevices lose, in modes volume and decoded",
            &mut material.occlusion,
            1.0,
        ),
    ] {
        row(ui, name, help, |ui| ui.add(Slider::new(value, 0.0..=most).max_decimals(2)));
    }
}
