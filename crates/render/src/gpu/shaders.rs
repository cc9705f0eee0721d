//! [`shaders`]: the text of every shader, for the device and for other compilers to check.

/// A shader as it is given to the driver.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Shader {
    /// The name, which is that of its file.
    pub name: &'static str,
    /// WGSL, with the parts that it shares with others in front.
    pub source: String,
}

const VIEW: &str = include_str!("../../shader/view.wgsl");
const SHADING: &str = include_str!("../../shader/shading.wgsl");

/// What is drawn into a picture has the view and the shading in front; the others stand alone.
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
