//! Files of the page, in the program.

/// File of the page.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asset {
    pub(super) path: &'static str,
    pub(super) content_type: &'static str,
    pub(super) text: &'static str,
}

const fn script(path: &'static str, text: &'static str) -> Asset {
    Asset { path, content_type: "text/javascript; charset=utf-8", text }
}

/// All files.
pub(super) const ASSETS: &[Asset] = &[
    Asset {
        path: "/",
        content_type: "text/html; charset=utf-8",
        text: include_str!("../assets/index.html"),
    },
    Asset {
        path: "/view.css",
        content_type: "text/css; charset=utf-8",
        text: include_str!("../assets/view.css"),
    },
    Asset {
        path: "/icon.svg",
        content_type: "image/svg+xml",
        text: include_str!("../assets/icon.svg"),
    },
    script("/address.js", include_str!("../assets/address.js")),
    script("/arm.js", include_str!("../assets/arm.js")),
    script("/arrows.js", include_str!("../assets/arrows.js")),
    script("/banner.js", include_str!("../assets/banner.js")),
    script("/bar.js", include_str!("../assets/bar.js")),
    script("/camera.js", include_str!("../assets/camera.js")),
    script("/charts.js", include_str!("../assets/charts.js")),
    script("/colours.js", include_str!("../assets/colours.js")),
    script("/controls.js", include_str!("../assets/controls.js")),
    script("/curves.js", include_str!("../assets/curves.js")),
    script("/feed.js", include_str!("../assets/feed.js")),
    script("/gl.js", include_str!("../assets/gl.js")),
    script("/hand_scene.js", include_str!("../assets/hand_scene.js")),
    script("/history.js", include_str!("../assets/history.js")),
    script("/joints_panel.js", include_str!("../assets/joints_panel.js")),
    script("/kinematics.js", include_str!("../assets/kinematics.js")),
    script("/linear.js", include_str!("../assets/linear.js")),
    script("/main.js", include_str!("../assets/main.js")),
    script("/node_panel.js", include_str!("../assets/node_panel.js")),
    script("/robot_scene.js", include_str!("../assets/robot_scene.js")),
    script("/shapes.js", include_str!("../assets/shapes.js")),
    script("/stage.js", include_str!("../assets/stage.js")),
    script("/text.js", include_str!("../assets/text.js")),
    script("/wrench_text.js", include_str!("../assets/wrench_text.js")),
];
