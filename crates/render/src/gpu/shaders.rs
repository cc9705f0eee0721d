//! [`shaders`]: source text of every shader, for the device and for validation by other compilers.

/// A shader as passed to the driver.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Shader {
    /// Name of the shader and of its file.
    pub name: &'static str,
    /// WGSL source, including the shared parts in front.
    pub source: String,
}

const VIEW: &str = include_str!("../../shader/view.wgsl");
const SHADING: &str = include_str!("../../shader/shading.wgsl");

/// Shaders of the image pass: view and shading are put in front. The others stand alone.
const DRAWN: [(&str, &str); 4] = [
    ("background", include_str!("../../shader/background.wgsl")),
    ("skin", include_str!("../../shader/skin.wgsl")),
    ("props", include_str!("../../shader/props.wgsl")),
    ("plane", include_str!("../../shader/plane.wgsl")),
];
const ALONE: [(&str, &str); 3] = [
    ("normals", include_str!("../../shader/normals.wgsl")),
    (
        "contact_shadow",
        include_str!("../../shader/contact_shadow.wgsl"),
    ),
    ("blur", include_str!("../../shader/blur.wgsl")),
];

/// All shaders of this crate.
///
/// ```
/// let shaders = incise_render::shaders();
/// assert!(shaders.iter().any(|shader| shader.name == "skin" && shader.source.contains("fn fragment")));
/// ```
#[must_use]
pub fn shaders() -> Vec<Shader> {
    let drawn = DRAWN.iter().map(|(name, own)| Shader {
        name,
        source: [VIEW, SHADING, own].join("\n"),
    });
    let alone = ALONE.iter().map(|(name, own)| Shader {
        name,
        source: (*own).to_owned(),
    });
    drawn.chain(alone).collect()
}
