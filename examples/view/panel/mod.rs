//! What the window consists of: the bar at the top, the settings at the side, the timeline at the bottom, and the view
//! of the mesh in the middle.

pub mod bar;
pub mod brush;
pub mod figures;
pub mod line;
pub mod open;
pub mod part;
pub mod save;
pub mod settings;
pub mod side;
pub mod style;
pub mod view;
pub mod viewport;
