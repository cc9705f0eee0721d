//! Key bindings, and the overlay that lists them.

use eframe::egui::{Align2, Context, Event, Grid, Key, Modifiers, RichText, Window};
use incise_render::ColorBy;

use crate::tool::Tool;

/// Effect of a key or button.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Action {
    Pause,
    Step,
    Reset,
    Undo,
    Use(Tool),
    Fit,
    Wireframe,
    Smooth,
    Color(ColorBy),
    Panel,
    Help,
    Cancel,
}

/// A key with its modifiers.
type Chord = (Modifiers, Key);

const PLAIN: Modifiers = Modifiers::NONE;

/// The keys with their names, actions and the texts of the overlay.
const KEYS: [(Chord, &str, Action, &str); 20] = [
    (
        (PLAIN, Key::Space),
        "Space",
        Action::Pause,
        "Pause or resume",
    ),
    ((PLAIN, Key::Period), ".", Action::Step, "Step one frame"),
    (
        (PLAIN, Key::R),
        "R",
        Action::Reset,
        "Reset to the first frame",
    ),
    (
        (Modifiers::COMMAND, Key::Z),
        "Ctrl+Z",
        Action::Undo,
        "Undo the last cut or reset",
    ),
    (
        (PLAIN, Key::U),
        "U",
        Action::Undo,
        "Undo the last cut or reset",
    ),
    (
        (PLAIN, Key::B),
        "B",
        Action::Use(Tool::Blade),
        "Cut: drag to move the blade",
    ),
    (
        (PLAIN, Key::G),
        "G",
        Action::Use(Tool::Grab),
        "Grab: drag to pull",
    ),
    (
        (PLAIN, Key::T),
        "T",
        Action::Use(Tool::Orbit),
        "Orbit with the left button",
    ),
    (
        (PLAIN, Key::F),
        "F",
        Action::Fit,
        "Fit the view to the body",
    ),
    ((PLAIN, Key::W), "W", Action::Wireframe, "Wireframe"),
    (
        (PLAIN, Key::S),
        "S",
        Action::Smooth,
        "Smooth or flat shading",
    ),
    (
        (PLAIN, Key::Num1),
        "1",
        Action::Color(ColorBy::Tissue),
        "Color by tissue",
    ),
    (
        (PLAIN, Key::Num2),
        "2",
        Action::Color(ColorBy::Color),
        "Color by constraint color",
    ),
    (
        (PLAIN, Key::Num3),
        "3",
        Action::Color(ColorBy::Cluster),
        "Color by cluster",
    ),
    (
        (PLAIN, Key::Num4),
        "4",
        Action::Color(ColorBy::Piece),
        "Color by piece",
    ),
    (
        (PLAIN, Key::Num5),
        "5",
        Action::Color(ColorBy::Stretch),
        "Color by stretch",
    ),
    (
        (PLAIN, Key::Num6),
        "6",
        Action::Color(ColorBy::Residual),
        "Color by residual",
    ),
    (
        (PLAIN, Key::P),
        "P",
        Action::Panel,
        "Show or hide the panel",
    ),
    (
        (PLAIN, Key::F1),
        "F1",
        Action::Help,
        "Show or hide this help",
    ),
    ((PLAIN, Key::Escape), "Esc", Action::Cancel, "Cancel, close"),
];

const MOUSE: [(&str, &str); 7] = [
    ("Left button", "Use the tool: cut, grab or orbit"),
    ("Right button", "Orbit"),
    ("Middle button", "Pan"),
    ("Wheel", "Zoom"),
    ("Shift and left button", "Orbit"),
    ("Ctrl and left button", "Pan"),
    ("Drop a file", "Open a scene, mesh or surface"),
];

/// Actions of the keys pressed since the last frame; none while a text field has the keyboard. `repeats` is true if keys
/// that are held down may repeat their actions.
pub(crate) fn actions(context: &Context, repeats: bool) -> Vec<Action> {
    if context.egui_wants_keyboard_input() {
        return Vec::new();
    }
    context.input(|input| {
        let actions = input.events.iter().filter_map(|event| match event {
            Event::Key {
                key,
                pressed: true,
                repeat,
                modifiers,
                ..
            } if repeats || !repeat => action(*key, *modifiers, *repeat),
            _ => None,
        });
        actions.collect()
    })
}

/// The action of a key. While a key is held down, only the action for a single frame repeats.
fn action(key: Key, modifiers: Modifiers, repeats: bool) -> Option<Action> {
    let mut known = KEYS.iter();
    let found = known.find(|((with, of), ..)| *of == key && modifiers.matches_logically(*with));
    let action = found.map(|(_, _, action, _)| *action);
    action.filter(|action| !repeats || *action == Action::Step)
}

/// Shows the overlay.
pub(crate) fn show(context: &Context, open: &mut bool) {
    Window::new("Keys")
        .open(open)
        .collapsible(false)
        .resizable(false)
        .anchor(Align2::CENTER_CENTER, [0.0, 0.0])
        .show(context, |ui| {
            Grid::new("keys")
                .num_columns(2)
                .spacing([24.0, 4.0])
                .show(ui, |ui| {
                    for (name, does) in MOUSE {
                        ui.label(RichText::new(name).strong());
                        ui.label(does);
                        ui.end_row();
                    }
                    for (_, name, _, does) in KEYS {
                        ui.label(RichText::new(name).monospace().strong());
                        ui.label(does);
                        ui.end_row();
                    }
                });
        });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_with_other_modifiers_are_other_keys() {
        let undo = action(Key::Z, Modifiers::COMMAND, false);
        assert_eq!(undo, Some(Action::Undo));
        assert_eq!(action(Key::Z, Modifiers::NONE, false), None);
        assert_eq!(action(Key::R, Modifiers::COMMAND, false), None);
        assert_eq!(action(Key::R, Modifiers::NONE, true), None);
        assert_eq!(
            action(Key::Period, Modifiers::NONE, true),
            Some(Action::Step)
        );
    }

    #[test]
    fn each_key_has_one_action() {
        for (i, (chord, ..)) in KEYS.iter().enumerate() {
            assert!(
                KEYS[..i].iter().all(|(other, ..)| other != chord),
                "{chord:?}"
            );
        }
    }
}
