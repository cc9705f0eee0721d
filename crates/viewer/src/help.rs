//! The keys, and the overlay that lists them.

use eframe::egui::{Align2, Context, Event, Grid, Key, Modifiers, RichText, Window};
use incise_render::ColorBy;

use crate::tool::Tool;

/// What a key does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Action {
    Pause,
    Step,
    Reset,
    Undo,
    Take(Tool),
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

/// The keys, what they do, and what the overlay says about them.
const KEYS: [(Chord, &str, Action, &str); 20] = [
    (
        (PLAIN, Key::Space),
        "Space",
        Action::Pause,
        "pause or go on",
    ),
    ((PLAIN, Key::Period), ".", Action::Step, "one frame"),
    (
        (PLAIN, Key::R),
        "R",
        Action::Reset,
        "back to the first frame",
    ),
    (
        (Modifiers::COMMAND, Key::Z),
        "Ctrl+Z",
        Action::Undo,
        "take the last cut back",
    ),
    ((PLAIN, Key::U), "U", Action::Undo, "the same"),
    (
        (PLAIN, Key::B),
        "B",
        Action::Take(Tool::Blade),
        "blade: drag to cut",
    ),
    (
        (PLAIN, Key::G),
        "G",
        Action::Take(Tool::Hand),
        "hand: drag to grab and pull",
    ),
    (
        (PLAIN, Key::T),
        "T",
        Action::Take(Tool::SettingChange),
        "turn the view with the left button, too",
    ),
    ((PLAIN, Key::F), "F", Action::Fit, "see the whole body"),
    ((PLAIN, Key::W), "W", Action::Wireframe, "wireframe"),
    ((PLAIN, Key::S), "S", Action::Smooth, "smooth or flat"),
    (
        (PLAIN, Key::Num1),
        "1",
        Action::Color(ColorBy::Tissue),
        "tissue",
    ),
    (
        (PLAIN, Key::Num2),
        "2",
        Action::Color(ColorBy::Color),
        "colors of constraints",
    ),
    (
        (PLAIN, Key::Num3),
        "3",
        Action::Color(ColorBy::Cluster),
        "clusters",
    ),
    (
        (PLAIN, Key::Num4),
        "4",
        Action::Color(ColorBy::Piece),
        "pieces",
    ),
    (
        (PLAIN, Key::Num5),
        "5",
        Action::Color(ColorBy::Stretch),
        "stretch",
    ),
    (
        (PLAIN, Key::Num6),
        "6",
        Action::Color(ColorBy::Residual),
        "residual",
    ),
    ((PLAIN, Key::P), "P", Action::Panel, "panel"),
    ((PLAIN, Key::F1), "F1", Action::Help, "this help"),
    ((PLAIN, Key::Escape), "Esc", Action::Cancel, "let go, close"),
];

const MOUSE: [(&str, &str); 5] = [
    ("left button", "what is in hand: blade, hand"),
    ("right button", "turn the view"),
    ("middle button", "move the view"),
    ("wheel", "closer, farther"),
    ("drop a file", "load a scene, a mesh or a surface"),
];

/// Actions of the keys pressed since the last frame; none while a text field has the keyboard.
pub(crate) fn actions(context: &Context) -> Vec<Action> {
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
            } => action(*key, *modifiers, *repeat),
            _ => None,
        });
        actions.collect()
    })
}

/// What a key asks for. Held down, only the one for a frame asks again.
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
    fn no_key_does_two_things() {
        for (i, (chord, ..)) in KEYS.iter().enumerate() {
            assert!(
                KEYS[..i].iter().all(|(other, ..)| other != chord),
                "{chord:?}"
            );
        }
    }
}
