//! Masses as integers: flows are then exact, and a tie is a tie.

use super::TransportError;

/// Bits of the total mass; a double holds 53.
const BITS: u32 = 52;
/// Totals that differ by less, relatively, are taken as equal.
const BALANCE: f64 = 1e-9;

/// Integer masses of the places that hold any, with room below the last digit for the perturbation.
#[derive(Debug, Default)]
pub(super) struct Units {
    /// Places of the sources and targets that hold mass.
    pub rows: Vec<u32>,
    pub columns: Vec<u32>,
    /// Masses of these, both sides with the same total, in units of `1 << room`.
    pub supply: Vec<i64>,
    pub demand: Vec<i64>,
    /// Bits below a unit of mass.
    pub room: u32,
    /// Mass of one unit.
    pub unit: f64,
}

impl Units {
    pub fn fill(&mut self, supply: &[f64], demand: &[f64]) -> Result<(), TransportError> {
        if supply.is_empty() || demand.is_empty() {
            return Err(TransportError::Empty { sources: supply.len(), targets: demand.len() });
        }
        let totals = [total(supply, "source")?, total(demand, "target")?];
        if (totals[0] - totals[1]).abs() > BALANCE * totals[0].max(totals[1]) {
            return Err(TransportError::Unbalanced { supply: totals[0], demand: totals[1] });
        }
        // more than twice the sources fit below one unit, so that rounding takes the perturbation away
        self.room = (2 * supply.len() + 2).next_power_of_two().trailing_zeros();
        let bits = BITS.min(62 - self.room);
        let whole = (1_i64 << bits) as f64;
        self.unit = totals[0] / whole;
        integers(supply, totals[0], whole, &mut self.rows, &mut self.supply);
        integers(demand, totals[1], whole, &mut self.columns, &mut self.demand);
        for m in self.supply.iter_mut().chain(&mut self.demand) {
            *m <<= self.room;
        }
        Ok(())
    }
}

fn total(masses: &[f64], side: &'static str) -> Result<f64, TransportError> {
    if let Some(place) = masses.iter().position(|m| !(m.is_finite() && *m >= 0.0)) {
        return Err(TransportError::Mass { side, place, found: masses[place] });
    }
    let sum: f64 = masses.iter().sum();
    if sum <= 0.0 {
        return Err(TransportError::NoMass { side });
    }
    if !sum.is_finite() {
        let place = (0..masses.len()).max_by(|a, b| masses[*a].total_cmp(&masses[*b])).unwrap_or(0);
        return Err(TransportError::Mass { side, place, found: masses[place] });
    }
    Ok(sum)
}

/// Parts of `whole` units; what rounding leaves goes to the largest.
fn integers(masses: &[f64], total: f64, whole: f64, places: &mut Vec<u32>, units: &mut Vec<i64>) {
    places.clear();
    units.clear();
    let scale = whole / total;
    let (mut sum, mut largest) = (0_i64, 0);
    for (place, m) in masses.iter().enumerate() {
        // (m / total) first where the scale alone would overflow
        let part = if scale.is_finite() { m * scale } else { m / total * whole };
        let part = part.round() as i64;
        if part > 0 {
            if units.get(largest).is_none_or(|l| part > *l) {
                largest = units.len();
            }
            sum += part;
            places.push(place as u32);
            units.push(part);
        }
    }
    if let Some(l) = units.get_mut(largest) {
        *l += whole as i64 - sum;
    }
}
