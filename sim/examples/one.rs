use shakedown_sim::*; use shakedown_gripper_assets::*; use shakedown_objects::*;
fn main(){
    let root=std::path::Path::new("/work/shared/acronym/seen");
    let args:Vec<String>=std::env::args().skip(1).collect();
    let pat=&args[0]; let k:usize=args[1].parse().unwrap(); let sets=&args[2..];
    let g=Gripper::load("franka_panda").unwrap(); let p=Protocol::load("acronym",sets).unwrap();
    let f=std::fs::read_dir(root.join("grasps")).unwrap().map(|e|e.unwrap().path()).find(|p|p.to_str().unwrap().contains(pat)).unwrap();
    let f=read_grasps(&f,&ReadOptions::default()).unwrap();
    let o=Object::load(&ObjectSpec{mesh:root.join(f.object.mesh.as_ref().unwrap()),scale:f.object.scale,density_kg_m3:f.object.density_kg_m3,..Default::default()}).unwrap();
    let s=Scene::new(&o,&g,&p,None,pieces::default_cache_directory().as_deref()).unwrap();
    println!("mass {} com {:?}",s.mass_kg,o.mass.com_m);
    if k<10000 { let (out,tr)=run_trial_traced(&s,&f.grasps[k].object_from_hand); println!("{:?}",out); for fr in tr.frames.iter().take(40){ let h=fr.world_from_hand.inverse()*fr.world_from_object*o.mass.com_m; println!("{:.3} L {:.4} R {:.4} obj {:.4} {:.4} {:.4} ang {:.3}",fr.t_s,fr.finger_m[0],fr.finger_m[1],h.x,h.y,h.z,fr.world_from_object.rotation.angle_to(&tr.frames[0].world_from_object.rotation)); } return; }
    for (i,q) in f.grasps.iter().enumerate().take(k-10000){ let r=run_trial(&s,&q.object_from_hand); if q.label==Some(true) && !r.is_held(){ println!("{i} {:?} {:?} w {:?} force {:?} clos {:?} {:?}",r.label,r.stage,r.width_m,r.grip_force_n,r.closing_linear_m,r.closing_angular_rad);} }
}
