use shakedown_classifier::*; use shakedown_gripper_assets::*; use shakedown_objects::*; use nalgebra::*; use shakedown_objects::surface::Lanes; use std::ops::ControlFlow;
fn main(){
    let root=std::path::Path::new("/work/shared/acronym/seen");
    let f=read_grasps(&root.join("grasps/Mug_10f6e09036350e92b3f21f1137c3c347_0.0002682457830986903.h5"),&ReadOptions::default()).unwrap();
    let o=Object::load(&ObjectSpec{mesh:root.join(f.object.mesh.as_ref().unwrap()),scale:f.object.scale,density_kg_m3:f.object.density_kg_m3,..Default::default()}).unwrap();
    let g=Gripper::load("franka_panda").unwrap(); let h=HandModel::new(&g,0.08).unwrap(); 
    let mut st=12345u64; let mut r=||{st^=st<<13;st^=st>>7;st^=st<<17;(st>>11) as f64/(1u64<<53) as f64};
    let mut gauss=||{let (a,b):(f64,f64)=(r(),r());(-2.0*a.ln()).sqrt()*(6.283185307*b).cos()};
    let poses:Vec<_>=f.grasps.iter().map(|q|{let t=Translation3::new(gauss()*0.015,gauss()*0.015,gauss()*0.015);let a=Vector3::new(gauss(),gauss(),gauss()).normalize()*gauss()*0.3;q.object_from_hand*Isometry3::from_parts(t,UnitQuaternion::new(a))}).collect();
    for (name,ps) in [("perturbed",poses),("as is",f.grasps.iter().map(|g|g.object_from_hand).collect::<Vec<_>>())]{
        let mut per=[0usize;8]; let mut tri=0usize;
        for p in &ps { let mut l=Lanes::default(); for (i,b) in h.convex_bodies.iter().enumerate(){let (a,c)=b.bounds(); l.set(i,a.coords.cast(),c.coords.cast());} l.set(7,h.region[0].cast(),h.region[1].cast());
          o.surface.visit_near(&p.inverse(),&mut l,|_,_,_,m|{tri+=1; for i in 0..8 {per[i]+=(m>>i&1) as usize;} ControlFlow::Continue(())}); }
        println!("{name}: tri {:.1} per body {:?}",tri as f64/ps.len() as f64,per.map(|x|x as f64/ps.len() as f64));
    }
}
