//! Window with the list of keys and mouse actions.

use egui::{Context, Grid, KeyboardShortcut, Window};

use crate::model::actions::KEYS;

/// Mouse actions in the picture.
const MOUSE: [(&str, &str); 8] = [
    ("Drag", "turn around the pivot"),
    ("Shift+Drag, middle", "move"),
    ("Wheel", "zoom towards the cursor"),
    ("Right drag", "window (left-right) and level (up-down)"),
    ("Double click", "make this point the pivot"),
    ("In the editor: drag", "move a point; with Shift finer"),
    ("Double click, Insert", "add a point"),
    ("In the editor: Delete", "remove the point"),
];

/// Shows the list in a window that can be closed.
pub fn show(context: &Context, open: &mut bool) {
    Window::new("Keys").open(open).resizable(false).collapsible(false).show(context, |ui| {
        ui.columns(2, |columns| {
            let (left, right) = KEYS.split_at(KEYS.len() / 2);
            for (i, (ui, rows)) in columns.iter_mut().zip([left, right]).enumerate() {
                Grid::new(("keys", i)).num_columns(2).spacing([14.0, 3.0]).show(ui, |ui| {
                    for row in rows {
                        ui.monospace(name_of(ui.ctx(), &row.key));
                        ui.label(row.help);
                        ui.end_row();
                    }
                });
            }
        });
        ui.separator();
        Grid::new("mouse").num_columns(2).spacing([14.0, 3.0]).show(ui, |ui| {
            for (what, help) in MOUSE {
                ui.monospace(what);
                ui.label(help);
                ui.end_row();
            }
        });
    });
}

/// Returns the name of a key, as it is printed on keyboards.
fn name_of(context: &Context, key: &KeyboardShortcut) -> String {
    let name = context.format_shortcut(key);
    name.replace(key.logical_key.name(), key.logical_key.symbol_or_name())
}
