//! What generated modules call: the contract between them and the runtime, fused products, and macros for what is the
//! same in every module.
//!
//! The module deliberately does not know any system.

use crate::real::Real;

/// The contract between generated modules and this crate: a change of what generated modules write or call has the
/// next number.
pub const CONTRACT: u32 = 1;

/// Fails to compile where a module was generated for another [`CONTRACT`]; every generated module begins with it.
///
/// ```
/// const _: () = hamel_runtime::generated_for::<{ hamel_runtime::CONTRACT }>();
/// ```
///
/// ```compile_fail
/// const _: () = hamel_runtime::generated_for::<0>();
/// ```
pub const fn generated_for<const VERSION: u32>() {
    assert!(
        VERSION == CONTRACT,
        "this module was generated for another version of hamel-runtime: \
         generate it again with the version of hamel that the runtime is from"
    );
}

/// `a * b + c`, by [`Real::mul_add`]: rounded once where the target fuses it in one instruction, twice elsewhere.
#[inline(always)]
pub fn fma<R: Real>(a: R, b: R, c: R) -> R {
    a.mul_add(b, c)
}

/// A generated structure of named numbers with their meanings, and the methods between it and an array; with
/// `defaults INFO`, the values that `INFO` has.
#[doc(hidden)]
#[macro_export]
macro_rules! numbers {
    ($structure:ident[$n:literal] $title:literal { $($field:ident: $doc:literal,)* } $(marker $marker:ident)?
     $(defaults $info:ident)?) => {
        #[doc = $title]
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[allow(dead_code, unreachable_pub, non_snake_case, reason = "names are those of the model")]
        pub struct $structure<R = f64> {
            $(#[doc = $doc] pub $field: R,)*
            $($marker: ::core::marker::PhantomData<R>,)?
        }

        #[allow(dead_code, unreachable_pub, non_snake_case, reason = "names are those of the model")]
        impl<R: $crate::Real> $structure<R> {
            /// The numbers by name from their values in order.
            #[inline]
            #[must_use]
            pub fn from_array(values: [R; $n]) -> Self {
                let [$($field),*] = values;
                Self { $($field,)* $($marker: ::core::marker::PhantomData)? }
            }

            /// The values in the order of the fields.
            #[inline]
            #[must_use]
            pub fn to_array(self) -> [R; $n] {
                [$(self.$field),*]
            }
        }

        $(impl<R: $crate::Real> Default for $structure<R> {
            fn default() -> Self {
                Self::from_array($info.defaults())
            }
        })?
    };
}

/// `System` of a generated structure with a state of that length, by its methods `rhs` and those that are named:
/// `pivots` with `check`, `signature`, `domain`; `ranks` stands for its `IndependentRows`.
#[doc(hidden)]
#[macro_export]
macro_rules! system {
    ($structure:ident[$n:literal] $($method:ident)*) => {
        impl<R: $crate::Real> $crate::System<R> for $structure<R> {
            type State = [R; $n];

            #[inline]
            fn rhs(&self, t: R, y: &[R; $n], dy: &mut [R; $n]) {
                self.rhs(t, y, dy);
            }

            $($crate::system!(@$method [$n]);)*
        }
    };
    (@pivots [$n:literal]) => {
        fn check(&self, t: R, y: &[R; $n]) -> Result<(), $crate::Failure> {
            self.check(t, y)
        }

        fn pivots(&self, t: R, y: &[R; $n], visit: &mut dyn FnMut($crate::Pivot<R>)) {
            self.pivots(t, y).into_iter().for_each(visit);
        }
    };
    (@signature [$n:literal]) => {
        #[inline]
        fn signature(&self, t: R, y: &[R; $n]) -> R {
            self.signature(t, y)
        }
    };
    (@ranks [$n:literal]) => {
        fn keeps_rank(&self, from: (R, &[R; $n]), to: (R, &[R; $n])) -> bool {
            $crate::keeps_rank(self, from, to)
        }
    };
    (@domain [$n:literal]) => {
        #[inline]
        fn domain(&self, t: R, y: &[R; $n]) -> Result<(), $crate::Failure> {
            self.domain(t, y)
        }
    };
}

/// `OverScalar` of a generated structure with a state of that length: fields that are numbers, and an array of them or
/// the marker of a structure without any.
#[doc(hidden)]
#[macro_export]
macro_rules! over_scalar {
    ($structure:ident[$n:literal] { $($field:ident),* $(,)? } $(array $array:ident)? $(marker $marker:ident)?) => {
        impl<Q: $crate::Real, R: $crate::Real> $crate::OverScalar<Q, R> for $structure<R> {
            type Over = $structure<Q>;

            fn over(&self, convert: impl Fn(R) -> Q) -> $structure<Q> {
                let _ = &convert;
                $structure {
                    $($field: convert(self.$field),)*
                    $($array: self.$array.map(&convert),)?
                    $($marker: ::core::marker::PhantomData,)?
                }
            }

            fn state_over(state: &[R; $n], convert: impl Fn(R) -> Q) -> [Q; $n] {
                state.map(convert)
            }
        }
    };
}

/// What every generated scene says of itself, within `impl Scene`: `INFO`, `prepare` by `Params` and `new`, the energy
/// by its method, and outputs by theirs at their places, arrays first.
#[doc(hidden)]
#[macro_export]
macro_rules! scene {
    (
        [$n:literal] $energy:ident,
        outputs [$total:literal] { $($array:ident[$range:expr],)* } { $($number:ident[$at:expr],)* }
    ) => {
        const INFO: $crate::SceneInfo = INFO;

        fn prepare(values: &[R]) -> Result<Self, $crate::ParamError> {
            Self::new(&Params::from_array(INFO.array_of(values)?))
        }

        $crate::scene!(@$energy [$n]);

        fn outputs_of(&self, t: R, y: &[R; $n], out: &mut [R]) {
            let _ = (t, y);
            if let Ok(out) = <&mut [R; $total]>::try_from(out) {
                let _ = &out;
                $(out[$range].copy_from_slice(&self.$array(t, y));)*
                $(out[$at] = self.$number(t, y);)*
            }
        }
    };
    (@energy [$n:literal]) => {
        fn energy_of(&self, t: R, y: &[R; $n]) -> Option<R> {
            Some(self.energy(t, y))
        }
    };
    (@conserved [$n:literal]) => {
        const CONSERVES_ENERGY: bool = true;

        $crate::scene!(@energy [$n]);
    };
    (@without_energy [$n:literal]) => {
        fn energy_of(&self, t: R, y: &[R; $n]) -> Option<R> {
            let _ = (t, y);
            None
        }
    };
    (@circles [$n:literal] $n_circles:literal [$n_inside:literal]) => {
        const N_CIRCLES: usize = $n_circles;

        fn on_circles_of(&self, y: &[R; $n], z: &mut [R]) {
            if let Ok(z) = <&mut [R; $n_inside]>::try_from(z) {
                *z = self.on_circles(y);
            }
        }

        fn rhs_on_circles_of(&self, t: R, z: &[R], dz: &mut [R]) {
            if let (Ok(z), Ok(dz)) = (<&[R; $n_inside]>::try_from(z), <&mut [R; $n_inside]>::try_from(dz)) {
                self.rhs_on_circles(t, z, dz);
            }
        }
    };
}

/// The system of a generated structure with cosine and sine of its angles behind the state, by `rhs_on_circles` and
/// `on_circles`.
#[doc(hidden)]
#[macro_export]
macro_rules! circles {
    ($structure:ident[$n:literal], $inside:ident[$n_inside:literal]) => {
        /// The equations with cosine and sine of angles behind the state, for integrators: what a step is computed
        /// with.
        #[derive(Clone, Copy, Debug, PartialEq)]
        #[allow(dead_code, unreachable_pub, reason = "not every crate uses or shows every item")]
        pub struct $inside<R = f64>($structure<R>);

        impl<R: $crate::Real> $crate::System<R> for $inside<R> {
            type State = [R; $n_inside];

            #[inline]
            fn rhs(&self, t: R, y: &[R; $n_inside], dy: &mut [R; $n_inside]) {
                self.0.rhs_on_circles(t, y, dy);
            }
        }

        impl<Q: $crate::Real, R: $crate::Real> $crate::OverScalar<Q, R> for $inside<R> {
            type Over = $inside<Q>;

            fn over(&self, convert: impl Fn(R) -> Q) -> $inside<Q> {
                $inside($crate::OverScalar::over(&self.0, convert))
            }

            fn state_over(state: &[R; $n_inside], convert: impl Fn(R) -> Q) -> [Q; $n_inside] {
                state.map(convert)
            }
        }

        impl<R: $crate::Real> $crate::Circles<R> for $structure<R> {
            type Inside = $inside<R>;

            fn inside(&self) -> $inside<R> {
                $inside(*self)
            }

            #[inline]
            fn on_circles(&self, y: &[R; $n]) -> [R; $n_inside] {
                self.on_circles(y)
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use super::fma;
    use crate::{OutputInfo, OverScalar, ParamError, ParamInfo, Scene, SceneInfo, System};

    const INFO: SceneInfo = SceneInfo::new("m", "s", &["x"])
        .with_params(&[ParamInfo::new("m", 1.5, "mass"), ParamInfo::new("g", 0.0, "gravity")])
        .with_outputs(&[OutputInfo::new("pair", &["a", "b"], ""), OutputInfo::new("one", &["one"], "")])
        .with_energy();

    #[derive(Clone, Copy, Debug, PartialEq)]
    struct Prepared<R = f64> {
        m: R,
        g: R,
        inputs: [R; 2],
    }

    impl<R: crate::Real> Prepared<R> {
        fn new(params: &Params<R>) -> Result<Self, ParamError> {
            INFO.require_finite(&params.to_array())?;
            Ok(Self { m: params.m, g: params.g, inputs: [R::ZERO; 2] })
        }

        fn rhs(&self, _: R, y: &[R; 1], dy: &mut [R; 1]) {
            *dy = [self.m * y[0]];
        }

        fn energy(&self, _: R, y: &[R; 1]) -> R {
            y[0]
        }

        fn pair(&self, _: R, _: &[R; 1]) -> [R; 2] {
            [self.m, self.g]
        }

        fn one(&self, t: R, _: &[R; 1]) -> R {
            t
        }
    }

    crate::numbers!(Params[2] "Numbers." { m: "Mass.", g: "Gravity.", } defaults INFO);
    crate::numbers!(Empty[0] "No numbers." {} marker scalar);
    crate::system!(Prepared[1]);
    crate::over_scalar!(Prepared[1] { m, g } array inputs);

    impl<R: crate::Real> Scene<R> for Prepared<R> {
        crate::scene!([1] conserved, outputs [3] { pair[0..2], } { one[2], });
    }

    #[test]
    fn fields_keep_their_order() {
        let params = Params::from_array([1.0, 2.0]);
        assert_eq!(params, Params { m: 1.0, g: 2.0 });
        assert_eq!(params.to_array(), [1.0, 2.0]);
        assert_eq!(Params::<f64>::default().to_array(), [1.5, 0.0]);
        assert_eq!(Empty::<f64>::from_array([]).to_array(), [0.0; 0]);
    }

    #[test]
    fn scenes_are_made_of_their_methods() {
        let prepared = Prepared::prepare(&[2.0, 3.0]).unwrap();
        let (mut rate, mut out) = ([0.0], [0.0; 3]);
        System::rhs(&prepared, 0.0, &[5.0], &mut rate);
        prepared.outputs_of(7.0, &[5.0], &mut out);
        assert_eq!((rate, prepared.energy_of(0.0, &[5.0]), out), ([10.0], Some(5.0), [2.0, 3.0, 7.0]));
        const { assert!(<Prepared as Scene<f64>>::CONSERVES_ENERGY) };
        assert_eq!(Prepared::prepare(&[f64::NAN, 1.0]).unwrap_err().condition, "m is finite");
        assert_eq!(Prepared::prepare(&[1.0]).unwrap_err().condition, "the number of values is 2");
    }

    #[test]
    fn every_number_is_converted() {
        let named = Prepared { m: 1.0, g: 2.0, inputs: [3.0, 4.0] };
        let over: Prepared<f32> = named.over(|x: f64| x as f32);
        assert_eq!(over, Prepared { m: 1.0, g: 2.0, inputs: [3.0, 4.0] });
        assert_eq!(<Prepared as OverScalar<f32>>::state_over(&[5.0], |x| x as f32), [5.0]);
    }

    #[test]
    fn a_fused_product_is_that_of_the_scalar() {
        assert_eq!(fma(2.0, 3.0, 4.0), 10.0);
    }
}
