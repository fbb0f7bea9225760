//! The claim: descent reaches at most the lowest error that the paper's solver ever reaches, in a tenth of its time.

use crate::rows::Row;

/// The ratio of times that is claimed.
pub const BAR: f64 = 10.0;

/// The error by which rows are compared.
pub type Error = fn(&Row) -> f64;

pub const ERRORS: [(&str, Error); 2] = [("E", |row| row.energy), ("strain", strain)];

pub fn strain(row: &Row) -> f64 {
    row.strain.map_or(f64::NAN, |s| f64::from(s.after.rms))
}

pub struct Claim {
    pub scene: String,
    pub backend: &'static str,
    pub by: &'static str,
    /// The row of pbd with the lowest error.
    pub pbd: Row,
    /// The fastest row of descent with at most that error; `None` if no row qualifies.
    pub descent: Option<Row>,
}

impl Claim {
    /// Time of pbd over time of descent.
    pub fn ratio(&self) -> Option<f64> {
        Some(self.pbd.ms?.median / self.descent.as_ref()?.ms?.median)
    }

    pub fn error(&self, row: &Row) -> f64 {
        ERRORS.iter().find(|(name, _)| *name == self.by).map_or(f64::NAN, |(_, error)| error(row))
    }
}

/// The claims per scene, backend and error for which pbd was run.
pub fn claims(rows: &[Row]) -> Vec<Claim> {
    let mut keys: Vec<(&str, &'static str)> = Vec::new();
    for row in rows {
        let key = (row.scene.as_str(), row.backend);
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    let mut claims = Vec::new();
    for (scene, backend) in keys {
        let of = |solver: &'static str| {
            rows.iter()
                .filter(move |row| (row.scene.as_str(), row.backend, row.solver) == (scene, backend, solver))
        };
        for (by, error) in ERRORS {
            let pbd = of("pbd").filter(|row| error(row).is_finite());
            let Some(pbd) = pbd.min_by(|a, b| error(a).total_cmp(&error(b))) else { continue };
            let ms = |row: &Row| row.ms.map_or(f64::INFINITY, |t| t.median);
            let descent = of("descent").filter(|row| error(row) <= error(pbd));
            let descent = descent.min_by(|a, b| ms(a).total_cmp(&ms(b))).cloned();
            claims.push(Claim { scene: scene.into(), backend, by, pbd: pbd.clone(), descent });
        }
    }
    claims
}
