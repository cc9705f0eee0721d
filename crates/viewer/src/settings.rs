//! Solver settings that trade speed for accuracy: a form over [`SolverSpec`].
//!
//! A change takes effect in the next frame. If the scene does not support a change, the reason is shown and the setting
//! keeps its value. Another method brings its own defaults.

use eframe::egui::{ComboBox, DragValue, Slider, SliderClamping, Ui};
use incise::scene::{Backend, Method, SolverSpec, Substeps};

/// A changed setting.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SettingChange {
    pub(crate) setting: &'static str,
    pub(crate) from: String,
    pub(crate) to: String,
    /// The solver section with the change.
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
        Method::Vbd => "VBD",
        _ => "other",
    }
}

fn backend_name(backend: Backend) -> &'static str {
    match backend {
        Backend::Cpu => "CPU",
        Backend::Gpu => "GPU",
        Backend::Auto => "Auto",
        _ => "other",
    }
}

fn substeps_name(substeps: Substeps) -> String {
    match substeps {
        Substeps::Fixed(count) => count.to_string(),
        _ => "auto".to_owned(),
    }
}

/// The kind of a clustering and its size: `serial:10` is `("serial", 10)`.
fn split_clustering(clustering: &str) -> (&str, u32) {
    let (kind, size) = clustering.split_once(':').unwrap_or((clustering, ""));
    (kind, size.parse().unwrap_or(10))
}

fn clustering_name(kind: &str, size: u32) -> String {
    match kind {
        "none" => kind.to_owned(),
        _ => format!("{kind}:{size}"),
    }
}

/// Shows the settings of `spec`; returns the one that was changed. `has_gpu` is true if a GPU can be chosen, `on_gpu`
/// if the simulation runs on one.
pub(crate) fn show(
    ui: &mut Ui,
    spec: &SolverSpec,
    has_gpu: bool,
    on_gpu: bool,
) -> Option<SettingChange> {
    let mut change = None;
    // `Auto` is shown as the backend that was chosen.
    let present = match spec.backend {
        Backend::Auto if on_gpu => Backend::Gpu,
        Backend::Auto => Backend::Cpu,
        chosen => chosen,
    };
    let mut changed = |setting, from: String, to: String, spec: SolverSpec| {
        if from != to {
            change = Some(SettingChange {
                setting,
                from,
                to,
                spec,
            });
        }
    };

    ComboBox::from_label("Method")
        .selected_text(method_name(spec.method))
        .show_ui(ui, |ui| {
            for method in METHODS {
                let mut chosen = spec.method;
                if ui
                    .selectable_value(&mut chosen, method, method_name(method))
                    .clicked()
                {
                    let (from, to) = (method_name(spec.method), method_name(method));
                    changed("Method", from.into(), to.into(), with_method(spec, method));
                }
            }
        });

    ui.horizontal(|ui| {
        let mut auto = spec.substeps == Substeps::Auto;
        let mut count = match spec.substeps {
            Substeps::Fixed(count) => count,
            _ => 30,
        };
        let slider = Slider::new(&mut count, 1..=spec.max_substeps.max(2))
            .logarithmic(true)
            .clamping(SliderClamping::Edits);
        let moved = ui.add_enabled(!auto, slider.text("Substeps")).changed();
        let automatic = ui.checkbox(&mut auto, "Auto");
        let automatic =
            automatic.on_hover_text("Substeps a frame, chosen by stiffness and frame time");
        if automatic.changed() || moved {
            let substeps = if auto {
                Substeps::Auto
            } else {
                Substeps::Fixed(count)
            };
            let spec_after = spec.clone().with(|spec| spec.substeps = substeps);
            let (from, to) = (substeps_name(spec.substeps), substeps_name(substeps));
            changed("Substeps", from, to, spec_after);
        }
    });

    let mut iterations = spec.iterations;
    let slider = Slider::new(&mut iterations, 1..=200)
        .logarithmic(true)
        .clamping(SliderClamping::Edits);
    let added = ui.add(slider.text("Iterations"));
    let added = added.on_hover_text("Passes over all constraints in a substep");
    if added.changed() {
        let spec_after = spec.clone().with(|spec| spec.iterations = iterations);
        let (from, to) = (spec.iterations.to_string(), iterations.to_string());
        changed("Iterations", from, to, spec_after);
    }

    let mut relaxation = spec.relaxation;
    let slider = Slider::new(&mut relaxation, 0.05..=1.9)
        .max_decimals(2)
        .clamping(SliderClamping::Edits);
    let added = ui.add(slider.text("Relaxation"));
    let added = added.on_hover_text("Part of each correction that is applied");
    if added.changed() {
        let spec_after = spec.clone().with(|spec| spec.relaxation = relaxation);
        let (from, to) = (
            format!("{:.2}", spec.relaxation),
            format!("{relaxation:.2}"),
        );
        changed("Relaxation", from, to, spec_after);
    }

    let (kind, size) = split_clustering(&spec.clustering);
    ui.horizontal(|ui| {
        let mut clustering = spec.clustering.clone();
        ComboBox::from_id_salt("clusters")
            .selected_text(kind)
            .show_ui(ui, |ui| {
                for other in CLUSTERINGS {
                    ui.selectable_value(&mut clustering, clustering_name(other, size), other);
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
                clustering = clustering_name(kind, size);
            }
        }
        ui.label("Clustering")
            .on_hover_text("Tets that one thread solves in order, and the largest number of them");
        if clustering != spec.clustering {
            let spec_after = spec
                .clone()
                .with(|spec| spec.clustering = clustering.clone());
            changed(
                "Clustering",
                spec.clustering.clone(),
                clustering,
                spec_after,
            );
        }
    });

    ui.add_enabled_ui(has_gpu, |ui| {
        ComboBox::from_label("Backend")
            .selected_text(backend_name(present))
            .show_ui(ui, |ui| {
                for backend in [Backend::Cpu, Backend::Gpu] {
                    let mut chosen = present;
                    ui.selectable_value(&mut chosen, backend, backend_name(backend));
                    if chosen != present {
                        let (from, to) = (backend_name(present), backend_name(backend));
                        let spec_after = spec.clone().with(|spec| spec.backend = backend);
                        changed("Backend", from.into(), to.into(), spec_after);
                    }
                }
            });
    });
    change
}

/// The solver section with another method and its defaults.
fn with_method(spec: &SolverSpec, method: Method) -> SolverSpec {
    let SolverSpec {
        iterations,
        relaxation,
        kappa_limit,
        ..
    } = SolverSpec::of(method);
    spec.clone().with(|spec| {
        spec.method = method;
        spec.iterations = iterations;
        spec.relaxation = relaxation;
        spec.kappa_limit = kappa_limit;
        spec.two_level = false;
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clustering_names_are_split_and_joined() {
        for name in ["none", "serial:10", "greedy-k:7", "pressure:32"] {
            let (kind, size) = split_clustering(name);
            assert_eq!(clustering_name(kind, size), name);
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
