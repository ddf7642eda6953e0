//! The models that the program comes with, by name: those of the repository as they were when it was built.
//!
//! They are part of the program and not of the library: a change of a model builds the program anew, and not
//! `cargo xtask`, which reads the files. The package for Python takes this file, too.
//!
//! `specs` and `shelf` are links to the folders of the model files, which a package holds copies of.
//!
//! Does not know: what is in a model.

use hamel_run::session::Shipped;

macro_rules! shipped {
    ($($folder:literal: [$($name:literal),* $(,)?]),* $(,)?) => {
        &[$($(($name, include_str!(concat!("../", $folder, "/", $name, ".hamel"))),)*)*]
    };
}

/// Names and texts, folder by folder, sorted by name within each.
pub(crate) const SHIPPED: Shipped = shipped! {
    "specs": [
        "appell_machine",
        "ball_on_rotating_table",
        "body_in_fluid",
        "body_in_fluid_by_translations",
        "camassa_holm",
        "chaplygin_ball",
        "chaplygin_gyro",
        "chaplygin_sleigh",
        "charged_particle",
        "double_spherical_pendulum",
        "euler_disk",
        "euler_disk_advected",
        "extended_pose",
        "free_rigid_body",
        "guiding_centre",
        "heavy_top",
        "heisenberg_body",
        "kirchhoff_body",
        "lotka_volterra",
        "mobile_robot",
        "point_vortices",
        "purcell_swimmer",
        "rolling_ball",
        "rolling_disk",
        "second_grade_fluid",
        "second_grade_fluid_3c",
        "servo_ball",
        "skew_sleigh",
        "snake",
        "snakeboard",
        "suslov",
        "tethered_body",
        "triangular_body",
        "two_arm_satellite",
        "two_arm_satellite_routh",
        "veselova",
        "wong_particle",
        "zeitlin_euler_3",
        "zeitlin_euler_5",
        "zeitlin_euler_7",
        "zeitlin_mhd_3",
        "zeitlin_mhd_5",
    ],
    "shelf": [
        "andrews_squeezer",
        "ball_in_rotating_cylinder",
        "ball_on_surface",
        "bicycle_with_rider",
        "bricard_linkage",
        "car_with_trailers",
        "clebsch_body",
        "double_cardan_joint",
        "ellipsoid_on_plane",
        "flyball_governor",
        "heisenberg_flywheel",
        "kovalevskaya_gyrostat",
        "magnetic_spherical_pendulum",
        "manakov_top",
        "motor_arm",
        "outer_solar_system",
        "pleiades",
        "pseudo_rigid_body",
        "quadrotor_with_load",
        "rattleback",
        "roller_racer",
        "satellite_with_wheels",
        "skate_on_incline",
        "snake_with_friction",
        "spherical_robot",
        "steklov_body",
        "stewart_platform",
        "suslov_bianchi",
        "tippe_top",
        "toda_lattice",
        "underwater_vehicle",
        "vortices_on_sphere",
        "whipple_bicycle",
        "whipple_bicycle_multipliers",
    ],
};

#[cfg(test)]
mod tests {
    use super::SHIPPED;

    #[test]
    fn every_model_of_the_repository_is_shipped() {
        let of_folder = |folder: &str| {
            let folder =
                std::fs::read_dir(format!("{}/../models/{folder}", env!("CARGO_MANIFEST_DIR"))).unwrap();
            let names = folder.map(|file| file.unwrap().file_name().into_string().unwrap());
            let mut names: Vec<String> =
                names.filter_map(|name| Some(name.strip_suffix(".hamel")?.to_owned())).collect();
            names.sort();
            names
        };
        let names = [of_folder("specs"), of_folder("shelf")].concat();
        assert_eq!(SHIPPED.iter().map(|(name, _)| (*name).to_owned()).collect::<Vec<_>>(), names);
        let mut unique = names.clone();
        unique.sort();
        unique.dedup();
        assert_eq!(unique.len(), names.len(), "a name stands for one model");
    }
}
