//! The knobs that trade speed for accuracy: a form over [`SolverSpec`].
//!
//! Each turn is taken over at once by the running body; a turn that a scene does not allow is refused with its reason,
//! and the knob goes back. Changing the method takes the defaults that go with it.

use eframe::egui::{ComboBox, DragValue, Slider, SliderClamping, Ui};
use incise::scene::{Backend, Method, SolverSpec, Substeps};

/// A knob that was turned.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SettingChange {
    pub(crate) knob: &'static str,
    pub(crate) from: String,
    pub(crate) to: String,
    /// The section with the turn made.
    pub(crate) spec: SolverSpec,
}

const METHODS: [Method; 5] = [
    Method::Auto,
    Method::GaussSeidel,
    Method::Jacobi,
    Method::Chebyshev,
    Method::Vbd,
];

const CLUSTERINGS: [&str; 4] = ["none", "serial", "greedy-k", "pressure"];

fn method_name(method: Method) -> &'static str {
    match method {
        Method::Auto => "Auto",
        Method::GaussSeidel => "Gauss-Seidel",
        Method::Jacobi => "Jacobi",
        Method::Chebyshev => "Chebyshev",
        Method::Vbd => "vbd",
        _ => "other",
    }
}

fn backend_name(backend: Backend) -> &'static str {
    match backend {
        Backend::Cpu => "processor",
        Backend::Gpu => "GPU",
        Backend::Auto => "either",
    }
}

fn substeps_name(substeps: Substeps) -> String {
    match substeps {
        Substeps::Fixed(count) => count.to_string(),
        Substeps::Auto => "auto".to_owned(),
    }
}

/// The kind of a clustering and its size: `serial:10` is `("serial", 10)`.
fn parts(clustering: &str) -> (&str, u32) {
    let (kind, size) = clustering.split_once(':').unwrap_or((clustering, ""));
    (kind, size.parse().unwrap_or(10))
}

fn joined(kind: &str, size: u32) -> String {
    match kind {
        "none" => kind.to_owned(),
        _ => format!("{kind}:{size}"),
    }
}

/// Shows the knobs as `spec` has them; returns the one that was turned. `has_gpu` tells whether a GPU can be chosen,
/// `on_gpu` whether one computes.
pub(crate) fn show(
    ui: &mut Ui,
    spec: &SolverSpec,
    has_gpu: bool,
    on_gpu: bool,
) -> Option<SettingChange> {
    let mut turn = None;
    // `Auto` is shown as the backend that was chosen.
    let present = match spec.backend {
        Backend::Auto if on_gpu => Backend::Gpu,
        Backend::Auto => Backend::Cpu,
        chosen => chosen,
    };
    let mut turned = |knob, from: String, to: String, spec: SolverSpec| {
        if from != to {
            turn = Some(SettingChange {
                knob,
                from,
                to,
                spec,
            });
        }
    };

    ComboBox::from_label("method")
        .selected_text(method_name(spec.method))
        .show_ui(ui, |ui| {
            for method in METHODS {
                let mut chosen = spec.method;
                if ui
                    .selectable_value(&mut chosen, method, method_name(method))
                    .clicked()
                {
                    let (from, to) = (method_name(spec.method), method_name(method));
                    turned("method", from.into(), to.into(), with_method(spec, method));
                }
            }
        });

    ui.horizontal(|ui| {
        let mut auto = spec.substeps == Substeps::Auto;
        let mut count = match spec.substeps {
            Substeps::Fixed(count) => count,
            Substeps::Auto => 30,
        };
        let slider = Slider::new(&mut count, 1..=spec.max_substeps.max(2))
            .logarithmic(true)
            .clamping(SliderClamping::Edits);
        let moved = ui.add_enabled(!auto, slider.text("substeps")).changed();
        if ui.checkbox(&mut auto, "auto").changed() || moved {
            let substeps = if auto {
                Substeps::Auto
            } else {
                Substeps::Fixed(count)
            };
            let spec_after = SolverSpec {
                substeps,
                ..spec.clone()
            };
            let (from, to) = (substeps_name(spec.substeps), substeps_name(substeps));
            turned("substeps", from, to, spec_after);
        }
    });

    let mut iterations = spec.iterations;
    let slider = Slider::new(&mut iterations, 1..=200)
        .logarithmic(true)
        .clamping(SliderClamping::Edits);
    if ui.add(slider.text("iterations")).changed() {
        let spec_after = SolverSpec {
            iterations,
            ..spec.clone()
        };
        let (from, to) = (spec.iterations.to_string(), iterations.to_string());
        turned("iterations", from, to, spec_after);
    }

    let mut relaxation = spec.relaxation;
    let slider = Slider::new(&mut relaxation, 0.05..=1.9)
        .max_decimals(2)
        .clamping(SliderClamping::Edits);
    if ui.add(slider.text("relaxation")).changed() {
        let spec_after = SolverSpec {
            relaxation,
            ..spec.clone()
        };
        let (from, to) = (
            format!("{:.2}", spec.relaxation),
            format!("{relaxation:.2}"),
        );
        turned("relaxation", from, to, spec_after);
    }

    let (kind, size) = parts(&spec.clustering);
    ui.horizontal(|ui| {
        let mut clustering = spec.clustering.clone();
        ComboBox::from_id_salt("clusters")
            .selected_text(kind)
            .show_ui(ui, |ui| {
                for other in CLUSTERINGS {
                    ui.selectable_value(&mut clustering, joined(other, size), other);
                }
            });
        if kind != "none" {
            let mut size = size;
            // Clusters beyond 32 tets are made for workgroups of a GPU.
            let value = DragValue::new(&mut size)
                .range(2..=256)
                .clamp_existing_to_range(false)
                .speed(0.1);
            if ui.add(value).changed() {
                clustering = joined(kind, size);
            }
        }
        ui.label("clusters");
        if clustering != spec.clustering {
            let spec_after = SolverSpec {
                clustering: clustering.clone(),
                ..spec.clone()
            };
            turned("clusters", spec.clustering.clone(), clustering, spec_after);
        }
    });

    ui.add_enabled_ui(has_gpu, |ui| {
        ComboBox::from_label("computed by")
            .selected_text(backend_name(present))
            .show_ui(ui, |ui| {
                for backend in [Backend::Cpu, Backend::Gpu] {
                    let mut chosen = present;
                    ui.selectable_value(&mut chosen, backend, backend_name(backend));
                    if chosen != present {
                        let (from, to) = (backend_name(present), backend_name(backend));
                        let spec_after = SolverSpec {
                            backend,
                            ..spec.clone()
                        };
                        turned("computed by", from.into(), to.into(), spec_after);
                    }
                }
            });
    });
    turn
}

/// The section with another method and what goes with that.
fn with_method(spec: &SolverSpec, method: Method) -> SolverSpec {
    let SolverSpec {
        iterations,
        relaxation,
        kappa_limit,
        ..
    } = SolverSpec::of(method);
    SolverSpec {
        method,
        iterations,
        relaxation,
        kappa_limit,
        two_level: false,
        ..spec.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_clusterings_come_apart_and_together() {
        for name in ["none", "serial:10", "greedy-k:7", "pressure:32"] {
            let (kind, size) = parts(name);
            assert_eq!(joined(kind, size), name);
            assert!(name.parse::<incise::clustering::Method>().is_ok(), "{name}");
        }
    }

    #[test]
    fn a_method_brings_its_defaults() {
        let spec = with_method(&SolverSpec::default(), Method::Jacobi);
        assert_eq!((spec.iterations, spec.relaxation), (20, 0.1));
        let back = with_method(&spec, Method::Auto);
        assert_eq!(back, SolverSpec::default());
    }
}
