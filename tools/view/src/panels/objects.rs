//! Panel of the objects (fits and labels), each with its visibility, colour and opacity; they can be deleted.
//!
//! A list of many has a field to search in, a heading for each kind, and a height of its own; only the rows that are in
//! view are laid out.

use std::collections::BTreeSet;
use std::ops::Range;

use egui::{Align, Button, Id, Label, Layout, RichText, ScrollArea, Slider, TextEdit, Ui, vec2};
use engine::render::UsualLook;
use engine::splat::{StructureKind, kind_of_structure, usual_colours};
use engine::transfer::{PRESETS, TransferFunction};
use engine::unit::Unit;
use glam::{DVec3, Vec3};

use super::widgets::colour_button;
use crate::model::actions::Action;
use crate::model::deletions::{Deletion, Target};
use crate::model::panel_info::PanelInfo;
use crate::model::state::{Object, ViewState};
use crate::model::transfer::Transfer;
use crate::panels::theme::SIGNAL;

/// Greatest number of objects of a list without headings, search and a height of its own.
const FEW: usize = 8;
/// Height of a list of many, points of the screen.
const HEIGHT: f32 = 330.0;
/// Width of an eye, points of the screen.
const EYE: f32 = 18.0;
/// Objects that are named in the explanation of the warning.
const NAMED: usize = 12;

/// What the list knows from frame to frame.
#[derive(Clone, Debug, Default)]
struct Memory {
    /// What the names are searched for.
    search: String,
    /// Headings whose objects are folded away.
    folded: BTreeSet<&'static str>,
    /// The row that is shown alone, and which rows were visible before.
    alone: Option<(usize, Vec<bool>)>,
}

impl Memory {
    /// Shows one row alone; a second time it shows again what was visible before.
    fn show_alone(&mut self, row: usize, objects: &mut [Object]) {
        let visible = |objects: &[Object]| objects.iter().map(|o| o.visible).collect::<Vec<_>>();
        match self
            .alone
            .take()
            .filter(|(alone, before)| is_alone(*alone, objects) && before.len() == objects.len())
        {
            Some((alone, before)) if alone == row => {
                objects.iter_mut().zip(before).for_each(|(object, was)| object.visible = was);
                return;
            }
            // From one to the next: what was visible before both is kept.
            Some((_, before)) => self.alone = Some((row, before)),
            None => self.alone = Some((row, visible(objects))),
        }
        objects.iter_mut().enumerate().for_each(|(i, object)| object.visible = i == row);
    }

    /// Returns the row that is shown alone, if what is visible is still that.
    fn alone(&self, objects: &[Object]) -> Option<usize> {
        self.alone.as_ref().map(|(row, _)| *row).filter(|row| is_alone(*row, objects))
    }
}

/// Returns true if a row is the only visible one.
fn is_alone(row: usize, objects: &[Object]) -> bool {
    objects.iter().enumerate().all(|(i, object)| object.visible == (i == row))
}

/// Line of the list.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Line {
    /// Heading of the objects of some kinds.
    Heading(&'static str),
    /// Row of an object.
    Row(usize),
}

/// Returns the lines of a list of many: under each heading the objects of its kinds that are searched for. What is found
/// is shown also where it is folded away.
fn lines(objects: &[Object], memory: &Memory) -> Vec<Line> {
    let words: Vec<String> = memory.search.to_lowercase().split_whitespace().map(str::to_owned).collect();
    let mut found: Vec<(StructureKind, usize)> = objects
        .iter()
        .enumerate()
        .filter(|(_, object)| {
            let name = object.name.to_lowercase();
            words.iter().all(|word| name.contains(word))
        })
        .map(|(row, object)| (kind_of_structure(&object.name), row))
        .collect();
    found.sort();
    let mut lines = Vec::new();
    let mut heading = "";
    for (kind, row) in found {
        if kind.heading() != heading {
            heading = kind.heading();
            lines.push(Line::Heading(heading));
        }
        if !words.is_empty() || !memory.folded.contains(heading) {
            lines.push(Line::Row(row));
        }
    }
    lines
}

/// Shows the list. Without `actions` objects cannot be saved.
pub fn show(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>, actions: Option<&mut Vec<Action>>) {
    if info.fitted {
        ui.weak("The fitted splats, not saved yet.");
        return;
    }
    if state.objects.is_empty() {
        ui.weak("Open splats, or drop a file here.");
        return;
    }
    let unseen = unseen(state, info);
    warning(ui, state, info, &unseen);
    if state.objects.len() > 1 {
        ui.horizontal(|ui| {
            for (text, visible) in [("Show all", true), ("Hide all", false)] {
                if ui.small_button(text).on_hover_text("all objects of the list").clicked() {
                    state.objects.iter_mut().for_each(|o| o.visible = visible);
                }
            }
            let usual = ui.small_button("Usual look");
            let help = "give each object the usual colour for its name and a function for its kind";
            if usual.on_hover_text(help).clicked() {
                take_usual_look(state, info);
            }
        });
    }
    let id = Id::new("list of objects");
    let mut memory: Memory = ui.data(|data| data.get_temp(id)).unwrap_or_default();
    let colours: Vec<DVec3> = usual_colours(state.objects.iter().map(|object| object.name.as_str()))
        .into_iter()
        .map(|colour| Vec3::from_array(colour).as_dvec3())
        .collect();
    let mut list = List { info, unseen: &unseen, colours: &colours, actions };
    if state.objects.len() <= FEW {
        (0..state.objects.len()).for_each(|row| list.row(ui, state, &mut memory, row));
    } else {
        list.many(ui, state, &mut memory);
    }
    ui.data_mut(|data| data.insert_temp(id, memory));
    restore(ui, &mut state.deleted, info);
}

/// Gives the objects and the scene their usual look.
fn take_usual_look(state: &mut ViewState, info: &PanelInfo<'_>) {
    let unit = if info.unit.is_empty() { Unit::Arbitrary } else { Unit::Hu };
    let names: Vec<String> = state.objects.iter().map(|object| object.name.clone()).collect();
    let names = names.iter().map(String::as_str);
    state.take_usual_look(&UsualLook::of_objects(names, info.object_intensities, unit));
}

/// Returns for each row what to say where it is switched on and its transfer function hardly shows it: anatomy must not
/// vanish without a sign.
fn unseen(state: &ViewState, info: &PanelInfo<'_>) -> Vec<Option<String>> {
    let scene = state.transfer.function().ok();
    let own_functions = state.mode.own_functions;
    let words = |(i, object): (usize, &Object)| {
        let own = info.object_intensities.get(i)?;
        let [low, high] = own.middle_half().filter(|_| object.visible && object.opacity > 0.0)?;
        let of_object = object.transfer.as_ref().filter(|_| own_functions);
        let of_object: Option<TransferFunction> = of_object.and_then(|function| function.function().ok());
        let seen = own.are_seen(of_object.as_ref().or(scene.as_ref())?);
        (!seen).then(|| format!("barely visible: mostly {low:.0} to {high:.0}{}", info.unit))
    };
    state.objects.iter().enumerate().map(words).collect()
}

/// Shows one warning for all objects that are barely visible, with a button that mends it.
fn warning(ui: &mut Ui, state: &mut ViewState, info: &PanelInfo<'_>, unseen: &[Option<String>]) {
    let rows = || state.objects.iter().zip(unseen).filter_map(|(object, why)| Some((object, why.as_ref()?)));
    let count = rows().count();
    if count == 0 {
        return;
    }
    let text = match (count, state.objects.len()) {
        (1, 1) => "This is barely visible.".to_owned(),
        (1, _) => rows().map(|(object, _)| format!("{} is barely visible.", object.name)).collect(),
        (count, all) => format!("{count} of {all} objects are barely visible."),
    };
    let mut help = "The transfer function is transparent for most of their splats:".to_owned();
    rows().take(NAMED).for_each(|(object, why)| help.push_str(&format!("\n{}: {why}", object.name)));
    if count > NAMED {
        help.push_str(&format!("\nand {} more", count - NAMED));
    }
    ui.horizontal_wrapped(|ui| {
        ui.colored_label(SIGNAL, text).on_hover_text(help);
        let mend = ui.small_button("Make them visible");
        if mend.on_hover_text("give all objects their usual look").clicked() {
            take_usual_look(state, info);
        }
    });
}

/// Rows of the list, with what they show.
struct List<'a> {
    info: &'a PanelInfo<'a>,
    unseen: &'a [Option<String>],
    /// Colours that the objects get first.
    colours: &'a [DVec3],
    /// What is asked for; `None` where objects cannot be saved.
    actions: Option<&'a mut Vec<Action>>,
}

impl List<'_> {
    /// Shows a list of many: search, headings, and the rows that are in view.
    fn many(&mut self, ui: &mut Ui, state: &mut ViewState, memory: &mut Memory) {
        ui.horizontal(|ui| {
            let field = TextEdit::singleline(&mut memory.search).hint_text("Search").desired_width(170.0);
            ui.add(field);
            if !memory.search.is_empty() && ui.small_button("×").on_hover_text("no search").clicked() {
                memory.search.clear();
            }
            let shown = state.objects.iter().filter(|object| object.visible).count();
            ui.weak(format!("{shown} of {} shown", state.objects.len()));
        });
        let lines = lines(&state.objects, memory);
        if lines.is_empty() {
            ui.weak("No object matches.");
        }
        let height = row_height(ui);
        let list = ScrollArea::vertical().id_salt("objects").max_height(HEIGHT).auto_shrink([false, true]);
        list.show_rows(ui, height, lines.len(), |ui, range: Range<usize>| {
            for line in &lines[range] {
                match *line {
                    Line::Heading(heading) => self.heading(ui, state, memory, heading),
                    Line::Row(row) => self.row(ui, state, memory, row),
                }
            }
        });
    }

    /// Shows a heading, which folds its objects away, and an eye for all of them.
    fn heading(&self, ui: &mut Ui, state: &mut ViewState, memory: &mut Memory, heading: &'static str) {
        let of_heading = |object: &&mut Object| kind_of_structure(&object.name).heading() == heading;
        let (mut all, mut visible) = (0, 0);
        for object in state.objects.iter_mut().filter(of_heading) {
            all += 1;
            visible += usize::from(object.visible);
        }
        line(ui, |ui| {
            if eye(ui, visible > 0).on_hover_text("show or hide all of them").clicked() {
                state.objects.iter_mut().filter(of_heading).for_each(|object| object.visible = visible == 0);
            }
            let folded = memory.folded.contains(heading);
            let arrow = if folded { "⏵" } else { "⏷" };
            let count = if visible == all { all.to_string() } else { format!("{visible} of {all}") };
            let text = RichText::new(format!("{arrow} {heading}  {count}")).strong();
            if ui.add(Button::new(text).frame(false)).clicked() && !memory.folded.remove(heading) {
                memory.folded.insert(heading);
            }
        });
    }

    /// Shows the row of an object.
    fn row(&mut self, ui: &mut Ui, state: &mut ViewState, memory: &mut Memory, row: usize) {
        let is_alone = memory.alone(&state.objects) == Some(row);
        let mut alone = false;
        let ViewState { objects, deleted, .. } = state;
        let several = objects.len() > 1;
        let object = &mut objects[row];
        ui.push_id(row, |ui| {
            line(ui, |ui| {
                let eye =
                    eye(ui, object.visible).on_hover_text("show or hide; with Shift, show only this one");
                if eye.clicked() && several && ui.input(|input| input.modifiers.shift) {
                    alone = true;
                } else if eye.clicked() {
                    object.visible = !object.visible;
                }
                tint(ui, &mut object.tint, self.colours.get(row).copied().unwrap_or(DVec3::ONE));
                let percent = Slider::from_get_set(0.0..=100.0, |new| {
                    if let Some(new) = new {
                        object.opacity = new / 100.0;
                    }
                    object.opacity * 100.0
                });
                ui.spacing_mut().slider_width = 44.0;
                ui.add(percent.suffix(" %").fixed_decimals(0)).on_hover_text("scales the opacity per mm");
                if several {
                    let only = ui.add(Button::selectable(is_alone, "Only"));
                    let help =
                        if is_alone { "show again what was shown before" } else { "show only this one" };
                    alone |= only.on_hover_text(help).clicked();
                }
                let is_deleted = more(ui, object, deleted, self.info, self.actions.as_deref_mut());
                let unseen = self.unseen.get(row).and_then(Option::as_ref);
                let mut name = RichText::new(&object.name);
                name = if is_deleted { name.weak().strikethrough() } else { name };
                name = if unseen.is_some() { name.color(SIGNAL) } else { name };
                let name = ui.add(Label::new(name).truncate());
                let mut help = object.name.clone();
                if let Some(count) = self.info.object_splats.get(row) {
                    help.push_str(&format!(": {count} splats"));
                }
                if let Some(function) = &object.transfer {
                    help.push_str(&format!(", function {}", function.name));
                }
                unseen.into_iter().for_each(|why| help.push_str(&format!(", {why}")));
                name.on_hover_text(help);
            });
        });
        if alone {
            memory.show_alone(row, objects);
        }
    }
}

/// Returns the height of a line, points of the screen.
fn row_height(ui: &Ui) -> f32 {
    let spacing = ui.spacing();
    let text = ui.text_style_height(&egui::TextStyle::Button) + 2.0 * spacing.button_padding.y;
    text.max(spacing.interact_size.y).ceil()
}

/// Lays out a line, all of which are equally high.
fn line(ui: &mut Ui, content: impl FnOnce(&mut Ui)) {
    let size = vec2(ui.available_width(), row_height(ui));
    ui.allocate_ui_with_layout(size, Layout::left_to_right(Align::Center), |ui| {
        ui.set_min_size(size);
        content(ui);
    });
}

fn eye(ui: &mut Ui, open: bool) -> egui::Response {
    let eye = if open { "👁" } else { "–" };
    ui.add(Button::new(eye).frame(false).min_size(vec2(EYE, 0.0)))
}

/// Shows the menu of an object: its transfer function, and what deletes, restores or saves it. Returns true if it is
/// deleted.
fn more(
    ui: &mut Ui,
    object: &mut Object,
    deleted: &mut Vec<Deletion>,
    info: &PanelInfo<'_>,
    actions: Option<&mut Vec<Action>>,
) -> bool {
    let target = Target { file: object.file, label: object.label };
    let own = Deletion::Object(target);
    let is_deleted = deleted.contains(&own);
    let menu = ui.menu_button("…", |ui| {
        if is_deleted {
            if ui.button("Restore").on_hover_text("undelete it").clicked() {
                deleted.retain(|deletion| *deletion != own);
            }
        } else if ui.button("Delete").on_hover_text("delete its splats; their file stays as it is").clicked()
        {
            deleted.push(own);
        }
        let save = Button::new("Save this object…");
        if let Some(actions) = actions
            && ui.add_enabled(!is_deleted, save).on_hover_text("save its splats to a separate file").clicked()
        {
            actions.push(Action::AskSaveObject(target));
        }
        own_function(ui, &mut object.transfer, info);
    });
    menu.response.on_hover_text("its transfer function; deletes, restores or saves its splats");
    is_deleted
}

/// Shows how many splats are deleted, if any are, and restores all of them.
pub(crate) fn restore(ui: &mut Ui, deleted: &mut Vec<Deletion>, info: &PanelInfo<'_>) {
    if deleted.is_empty() {
        return;
    }
    ui.horizontal(|ui| {
        let all = info.splats.unwrap_or(0) + info.deleted;
        ui.label(format!("{} of {all} splats are deleted", info.deleted))
            .on_hover_text("their files stay as they are");
        if ui.small_button("Restore all").on_hover_text("undelete everything").clicked() {
            deleted.clear();
        }
    });
}

/// Shows the choice between the transfer function of the scene and presets of the object's own.
fn own_function(ui: &mut Ui, own: &mut Option<Transfer>, info: &PanelInfo<'_>) {
    let text =
        own.as_ref().map_or("Transfer function".to_owned(), |f| format!("Transfer function: {}", f.name));
    let menu = ui.menu_button(text, |ui| {
        if ui.selectable_label(own.is_none(), "as the scene").clicked() {
            *own = None;
        }
        for preset in PRESETS {
            let chosen = own.as_ref().is_some_and(|function| function.name == preset.name);
            if ui.selectable_label(chosen, preset.name).on_hover_text(preset.about).clicked() {
                *own = Some(Transfer::new(&preset.over(info.range)));
            }
        }
    });
    menu.response.on_hover_text("its own, in mode decoded");
}

/// Shows the choice between a colour of the object's own, at first `first`, and that of the transfer function.
fn tint(ui: &mut Ui, tint: &mut Option<DVec3>, first: DVec3) {
    let mut own = tint.is_some();
    let check =
        ui.checkbox(&mut own, "").on_hover_text("a colour of its own instead of the transfer function's");
    if check.changed() {
        *tint = own.then_some(first);
    }
    match tint {
        Some(colour) => {
            colour_button(ui, colour, "the object's colour");
        }
        None => ui.add_space(ui.spacing().interact_size.x + ui.spacing().item_spacing.x),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn objects(names: &[&str]) -> Vec<Object> {
        (1..).zip(names).map(|(label, name)| Object::new(0, Some(label), *name)).collect()
    }

    #[test]
    fn many_stand_under_headings_are_found_and_folded_away() {
        let objects =
            objects(&["rib_left_1", "liver", "kidney_left", "trachea", "rib_left_2", "lung_lower_lobe_left"]);
        let mut memory = Memory::default();
        let headings = |lines: &[Line]| lines.iter().filter(|line| matches!(line, Line::Heading(_))).count();
        use Line::{Heading, Row};
        let bones = [Heading("Bones"), Row(0), Row(4)];
        let lungs = [Heading("Lungs and airways"), Row(5), Row(3)];
        let organs = [Heading("Organs"), Row(1), Row(2)];
        assert_eq!(lines(&objects, &memory), [organs, bones, lungs].concat());
        memory.folded.insert("Bones");
        assert_eq!(lines(&objects, &memory), [&organs[..], &bones[..1], &lungs].concat());
        memory.search = " LEFT ri".into();
        assert_eq!(lines(&objects, &memory), bones, "what is found is not folded away");
        memory.search = "heart".into();
        assert_eq!(headings(&lines(&objects, &memory)), 0);
    }

    #[test]
    fn one_is_shown_alone_and_then_again_what_was_shown_before() {
        let mut objects = objects(&["a", "b", "c", "d"]);
        objects[3].visible = false;
        let visible = |objects: &[Object]| objects.iter().map(|o| o.visible).collect::<Vec<_>>();
        let before = visible(&objects);
        let mut memory = Memory::default();
        memory.show_alone(1, &mut objects);
        assert_eq!((visible(&objects), memory.alone(&objects)), (vec![false, true, false, false], Some(1)));
        memory.show_alone(2, &mut objects);
        assert_eq!((visible(&objects), memory.alone(&objects)), (vec![false, false, true, false], Some(2)));
        memory.show_alone(2, &mut objects);
        assert_eq!((visible(&objects), memory.alone(&objects)), (before, None));
        // Where another one was switched on meanwhile, that is what was shown before.
        memory.show_alone(1, &mut objects);
        objects[0].visible = true;
        assert_eq!(memory.alone(&objects), None);
        let before = visible(&objects);
        memory.show_alone(1, &mut objects);
        memory.show_alone(1, &mut objects);
        assert_eq!(visible(&objects), before);
    }
}
